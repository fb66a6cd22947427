"""The options that Hydra's configuration groups offer, sub-folders included."""

from collections.abc import Iterator
from dataclasses import fields

from hydra import initialize_config_module
from hydra.core.global_hydra import GlobalHydra
from hydra.core.object_type import ObjectType
from hydra.plugins.config_source import ConfigSource

from geomotion.config import GmsConfig, NcdsConfig

_INTERNAL_SUFFIX = "_schema"  # bases of other options, of no use by themselves


def top_level_names(config_type: type[GmsConfig]) -> list[str]:
    """Everything that may stand before the first dot, slash or equals sign of an override."""
    names = [item.name for item in fields(config_type)]
    return [*names, "experiment"] if config_type is NcdsConfig else names


def group_options(*groups: str) -> dict[str, list[str]]:
    """Every option of each group, as it is written after ``group=``; a group without options is left out."""
    with initialize_config_module(version_base="1.3", config_module="geomotion.conf"):
        sources = GlobalHydra.instance().config_loader().get_sources()
    options = {group: sorted(set(_options_below(sources, group))) for group in groups}
    return {group: found for group, found in options.items() if found}


def _options_below(sources: list[ConfigSource], group: str, prefix: str = "") -> Iterator[str]:
    for source in (source for source in sources if source.is_group(group)):
        for name in source.list(group, results_filter=ObjectType.CONFIG):
            if not name.endswith(_INTERNAL_SUFFIX):
                yield prefix + name
        for name in source.list(group, results_filter=ObjectType.GROUP):
            yield from _options_below([source], f"{group}/{name}", f"{prefix}{name}/")
