"""Arms from settings."""

import functools
from pathlib import Path

from geomotion import config as schema
from geomotion.errors import InvalidSetting
from geomotion.robot import panda
from geomotion.robot.arm import Arm, read_arm
from geomotion.robot.gripper import Gripper
from geomotion.robot.panda_arm import panda_arm

PLANAR_URDF = Path(__file__).parent / "robot/urdf/planar_2dof.urdf"


def build(config: schema.ArmConfig) -> Arm:
    """The arm that the settings describe; the same object for the same settings.

    Raises:
        MissingData: If there is no such URDF.
        InvalidSetting: If it cannot be read, or what is between the links is no serial chain of joints that turn.
        UnknownName: If there is no such link.
    """
    ends = config.base_link, config.tip_link
    match config:
        case schema.PandaArm():
            return panda_arm(*ends)
        case schema.PlanarArm():
            return _read(PLANAR_URDF, *ends)
        case schema.UrdfArm():
            path = Path(config.urdf).expanduser()
            return _read(path, *ends, config.acceleration_rad_per_s2, config.jerk_rad_per_s3)
    raise InvalidSetting("arm", config.name, "panda, planar_2dof or urdf")


def gripper(config: schema.ArmConfig) -> Gripper | None:
    """What the arm can hold something with; None where nothing is known of a hand."""
    return panda.GRIPPER if isinstance(config, schema.PandaArm) else None


_read = functools.cache(read_arm)
