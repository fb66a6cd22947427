"""The options that Hydra's configuration groups offer, sub-folders included."""

import re
from collections.abc import Iterator
from dataclasses import fields

from hydra import initialize_config_module
from hydra.core.global_hydra import GlobalHydra
from hydra.core.object_type import ObjectType
from hydra.plugins.config_source import ConfigSource

from geomotion.config import CommandConfig, GmsConfig, NcdsConfig

CONFIG_TYPES: dict[str, type[CommandConfig]] = {"gms": GmsConfig, "ncds": NcdsConfig}
_GMS_GROUPS = {"dataset", "obstacle", "experiment", "space"}  # its other settings have one form each
_GMS_EXPERIMENT = re.compile(r"thesis/(gms|fig_[34]_.*)|regression/gms_.*|.*_geodesics")  # chapters 3, 4 of the thesis
_OF_GMS = {"experiment": _GMS_EXPERIMENT, "space": re.compile("joint|pose")}  # the other program has the rest
_OF_BOTH = {"demonstrated"}
_OF_NCDS = {"dataset": {"mmm", "panda/grasp_and_drop"}}  # people are no arms, and geodesics do not look
_INTERNAL_SUFFIX = "_schema"  # bases of other options, of no use by themselves


def top_level_names(config_type: type[CommandConfig]) -> list[str]:
    """Everything that may stand before the first dot, slash or equals sign of an override."""
    return [*(item.name for item in fields(config_type)), "experiment"]


def program_options(program: str) -> dict[str, list[str]]:
    """The options of one program, by group."""
    found = group_options(*top_level_names(CONFIG_TYPES[program]))
    is_gms = program == "gms"
    for group, of_gms in _OF_GMS.items():
        found[group] = [one for one in found[group] if one in _OF_BOTH or bool(of_gms.fullmatch(one)) == is_gms]
    for group, of_ncds in _OF_NCDS.items() if is_gms else ():
        found[group] = [one for one in found[group] if one not in of_ncds]
    return {group: options for group, options in found.items() if not is_gms or group in _GMS_GROUPS}


def group_options(*groups: str) -> dict[str, list[str]]:
    """Every option of each group, as it is written after ``group=``; a group without options is left out."""
    sources = _sources()
    options = {group: sorted(set(_options_below(sources, group))) for group in groups}
    return {group: found for group, found in options.items() if found}


def _sources() -> list[ConfigSource]:
    if GlobalHydra.instance().is_initialized():  # a command is at work
        return list(GlobalHydra.instance().config_loader().get_sources())
    with initialize_config_module(version_base="1.3", config_module="geomotion.conf"):
        return list(GlobalHydra.instance().config_loader().get_sources())


def _options_below(sources: list[ConfigSource], group: str, prefix: str = "") -> Iterator[str]:
    for source in (source for source in sources if source.is_group(group)):
        for name in source.list(group, results_filter=ObjectType.CONFIG):
            if not name.endswith(_INTERNAL_SUFFIX):
                yield prefix + name
        for name in source.list(group, results_filter=ObjectType.GROUP):
            yield from _options_below([source], f"{group}/{name}", f"{prefix}{name}/")
