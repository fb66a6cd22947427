"""Hydra's and OmegaConf's errors, retold in one line that says what to write instead."""

import re

from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, MissingMandatoryValue, OmegaConfBaseException

from geomotion.errors import UnknownName
from geomotion_cli.choices import group_options
from geomotion_cli.failures import did_you_mean


def retell(error: Exception) -> str:
    """One line about a configuration that could not be composed."""
    match error:
        case MissingConfigException(missing_cfg_file=str(path)) if "/" in path:
            return _unknown_option(path, error)
        case OverrideParseException():
            return f"cannot read {error.override!r}: {_first_sentence(error)}; settings are written key=value."
        case MissingMandatoryValue():
            return f"{error.full_key} has no value; set it with {error.full_key}=…"
        case HydraException(__cause__=OmegaConfBaseException() as cause):
            return _value_error(cause)
        case OmegaConfBaseException():
            return _value_error(error)
    return _first_sentence(error)


def unknown_key(key: str, config: DictConfig) -> str:
    """One line about a key that the configuration does not have, with the nearest one that it has."""
    parent, _, name = key.rpartition(".")
    siblings = _siblings(parent, config, OmegaConf.get_type(config))
    same_name = [other for other in _dotted_keys(config) if other.endswith(f".{name}") and other != key]
    near = [f"{parent}.{sibling}" if parent else sibling for sibling in siblings if sibling != name]
    guess = f" Did you mean {same_name[0]!r}?" if same_name else did_you_mean(key, near)
    return f"unknown setting {key!r}.{guess} Available{f' in {parent}' if parent else ''}: {', '.join(near) or 'none'}."


def _value_error(error: OmegaConfBaseException) -> str:
    if isinstance(error, ConfigAttributeError | ConfigKeyError) and error.full_key and error.parent_node is not None:
        return unknown_key(error.full_key, error.parent_node._get_root())
    reason = _first_sentence(error)
    return f"{error.full_key}: {reason}" if error.full_key else reason


def _unknown_option(path: str, error: MissingConfigException) -> str:
    """Name the nearest options; Hydra itself lists one folder only."""
    group, _, option = path.partition("/")
    if group == "hydra":
        group, _, option = path.rpartition("/")
    options = group_options(group).get(group) or list(error.options or [])
    folder = option.rpartition("/")[0] + "/"
    return str(UnknownName(group, option, [other for other in options if other.startswith(folder)] or options))


def _first_sentence(error: Exception) -> str:
    """The message without Hydra's search path, links and keys, on one line."""
    told = re.split(r"\n(?:Config search path:|See https?://|\s*full_key:|\s*Available options)", str(error), maxsplit=1)[0]
    return "; ".join(line.strip() for line in told.splitlines() if line.strip())


def _dotted_keys(config: DictConfig, prefix: str = "") -> list[str]:
    keys: list[str] = []
    for name in config:
        key = f"{prefix}{name}"
        keys.append(key)
        if not OmegaConf.is_missing(config, name) and OmegaConf.is_dict(config._get_node(name)):
            keys += _dotted_keys(config[name], f"{key}.")
    return keys
