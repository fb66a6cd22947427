"""Which program a configuration belongs to; only the one asked for is imported."""

from geomotion.config import CommandConfig, GmsConfig
from geomotion.stages.session import Program


def program_of(config: CommandConfig) -> Program:
    """`gms` or `ncds`."""
    if isinstance(config, GmsConfig):
        from geomotion.stages.gms_verbs import GMS

        return GMS
    from geomotion.stages.ncds_verbs import NCDS

    return NCDS
