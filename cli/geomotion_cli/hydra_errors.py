"""Hydra's and OmegaConf's errors, retold in one line that says what to write instead."""

import re
from collections.abc import Iterator
from dataclasses import fields, is_dataclass

from hydra.errors import (
    ConfigCompositionException,
    HydraException,
    MissingConfigException,
    OverrideParseException,
)
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, MissingMandatoryValue, OmegaConfBaseException

from geomotion.config import CommandConfig
from geomotion.errors import UnknownName
from geomotion_cli.choices import CONFIG_TYPES, group_options, program_options, top_level_names
from geomotion_cli.failures import did_you_mean

_OF_ANOTHER_PROGRAM = re.compile(r"In '(?P<group>\w+)/(?P<option>[^']+)': Could not override '(?P<missing>[^']+)'")


def retell(error: Exception) -> str:
    """One line about a configuration that could not be composed."""
    match error:
        case MissingConfigException(missing_cfg_file=str(path)) if "/" in path:
            return _unknown_option(path, error)
        case OverrideParseException():
            reason = _first_sentence(error).split("; ")[-1]
            return f"cannot read {error.override!r}: {reason}; settings are written key=value."
        case MissingMandatoryValue():
            return f"{error.full_key} has no value; set it with {error.full_key}=…"
        case ConfigCompositionException() if preset := _OF_ANOTHER_PROGRAM.match(str(error)):
            return _of_another_program(**preset.groupdict())
        case HydraException(__cause__=OmegaConfBaseException() as cause):
            return _value_error(cause)
        case OmegaConfBaseException():
            return _value_error(error)
    return _first_sentence(error)


def unknown_setting(key: str, config: DictConfig) -> str:
    """One line about a key that the configuration does not have, with the nearest one that it has."""
    parent, _, name = key.rpartition(".")
    siblings = _settings_in(config, parent)
    namesakes = [other for other in _all_settings(config) if other.endswith(f".{key}")]
    if namesakes:
        guess = f" Did you mean {namesakes[0]!r}?"
    else:
        guess = did_you_mean(name, siblings, prefix=f"{parent}." if parent else "")
    place = f" in {parent}" if parent else ""
    return f"unknown setting {key!r}.{guess} Available{place}: {', '.join(siblings) or 'none'}."


def _value_error(error: OmegaConfBaseException) -> str:
    if isinstance(error, ConfigAttributeError | ConfigKeyError) and error.full_key and error.parent_node is not None:
        return unknown_setting(error.full_key, error.parent_node._get_root())
    reason = _first_sentence(error)
    return f"{error.full_key}: {reason}" if error.full_key else reason


def _of_another_program(group: str, option: str, missing: str) -> str:
    """A preset that changes what only another program has."""
    chosen = f"{group}={option}"
    choices = {program: program_options(program).get(group, []) for program in CONFIG_TYPES}
    owners = [program for program, options in choices.items() if option in options]
    others = [f"{program} has {', '.join(choices[program])}" for program in CONFIG_TYPES if program not in owners]
    if not owners or not others:
        return f"{chosen} changes {missing!r}, which is not there to be changed."
    return f"{chosen} is a choice of {' and '.join(owners)}, whose setting {missing!r} it changes; {'; '.join(others)}."


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
    told = re.split(
        r"\n(?:Config search path:|See https?://|\s*full_key:|\s*Available options)", str(error), maxsplit=1
    )[0]
    return "; ".join(line.strip() for line in told.splitlines() if line.strip())


def _settings_in(config: DictConfig, parent: str = "") -> list[str]:
    """Names declared directly below `parent`."""
    node = OmegaConf.select(config, parent, throw_on_resolution_failure=False) if parent else config
    kind = OmegaConf.get_type(node) if OmegaConf.is_dict(node) else None
    if not parent and kind is not None and issubclass(kind, CommandConfig):
        return top_level_names(kind)
    return [item.name for item in fields(kind)] if is_dataclass(kind) else []


def _all_settings(config: DictConfig, parent: str = "") -> Iterator[str]:
    for name in _settings_in(config, parent):
        key = f"{parent}.{name}" if parent else name
        yield key
        yield from _all_settings(config, key)
