"""Names of single columns, shared by the stored layout and by the files that users bring (docs/data.md)."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

from geomotion.demos.demonstrations import UNIT_AXES, Array

METRES_PER = {"m": 1.0, "cm": 0.01, "mm": 0.001}
RADIANS_PER = {"rad": 1.0, "deg": math.pi / 180}
TIME_COLUMNS = ("time_s", "timestamp")
DEMO_COLUMNS = ("demo", "episode", "episode_index")
BOOKKEEPING_COLUMNS = ("frame_index", "index", "task_index")  # of LeRobot datasets
ALL_COLUMNS = (
    *TIME_COLUMNS, *DEMO_COLUMNS, "x", "y", "z", "x_mm", "y_mm", "z_mm", "position_m_x", "position_m_y", "position_m_z",
    "orientation_w", "orientation_x", "orientation_y", "orientation_z", "direction_x", "direction_y", "direction_z",
    "joint_1_rad", "joint_1_deg", "joint_1_rad_per_s", "panda_joint1", "q1",
    "velocity_m_per_s_x", "velocity_m_per_s_y", "velocity_m_per_s_z", "condition_target_x_m",
)  # fmt: skip

_JOINT = r"(?:\w+_)?joint(?:_?[a-z]?\d+)?"  # as URDFs call them: panda_joint1, shoulder_pan_joint, joint_a1

SCALAR_LAST = "orientation_xyzw"  # an array; columns of single axes may stand in any order

CONDITION = "condition"  # a column, or an array, that is constant within a demonstration

_PATTERNS = (
    (CONDITION, re.compile(r"condition_(?P<axis>\w+)")),
    ("position_m", re.compile(r"position_(?P<unit>m|cm|mm)_(?P<axis>[xyz]|\d+)")),
    ("position_m", re.compile(r"(?P<axis>[xyz])(?:_(?P<unit>m|cm|mm))?")),
    ("velocity_m_per_s", re.compile(r"velocity_(?P<unit>m|cm|mm)_per_s_(?P<axis>[xyz]|\d+)")),
    ("orientation_wxyz", re.compile(r"(?:orientation|quaternion|quat)_(?P<axis>[wxyz])")),
    ("orientation_wxyz", re.compile(r"q_?(?P<axis>[wxyz])")),
    ("direction_xyz", re.compile(r"direction_(?P<axis>[xyz])")),
    ("joint_velocity_rad_per_s", re.compile(r"joint_(?P<axis>.+)_rad_per_s")),
    ("joint_velocity_rad_per_s", re.compile(rf"(?P<axis>{_JOINT})_rad_per_s")),
    ("joints_rad", re.compile(r"joint_(?P<axis>.+)_(?:rad|(?P<unit>deg))")),
    ("joints_rad", re.compile(rf"(?P<axis>{_JOINT})(?:\.pos|[._]position)?(?:_rad|_(?P<unit>deg))?")),
    ("joints_rad", re.compile(r"q_?(?P<axis>\d+)(?:_rad|_(?P<unit>deg))?")),
)


@dataclass(frozen=True)
class Column:
    """Where a column belongs.

    Attributes:
        channel: Channel of a trajectory.
        axis: Its axis there: x, y, z, w, a number, or a joint's name.
        unit: Unit of a length in the name, or ``deg``; None where the name gives none or says ``rad``.
    """

    channel: str
    axis: str
    unit: str | None


def parse(name: str) -> Column | None:
    """What a column name means; None for a name outside the schema."""
    for channel, pattern in _PATTERNS:
        if match := pattern.fullmatch(name):
            groups = match.groupdict()
            return Column(channel, groups["axis"], groups.get("unit"))
    return None


def column_names(channel: str, width: int) -> list[str]:
    """The schema's names for the axes of a channel of `width` axes."""
    if channel in UNIT_AXES:
        return [f"{channel.partition('_')[0]}_{axis}" for axis in UNIT_AXES[channel]]
    if channel == "joints_rad":
        return [f"joint_{number}_rad" for number in range(1, width + 1)]
    if channel == "joint_velocity_rad_per_s":
        return [f"joint_{number}_rad_per_s" for number in range(1, width + 1)]
    axes = "xyz"[:width] if width <= 3 else [str(number) for number in range(width)]
    return [f"{channel}_{axis}" for axis in axes]


def joint_names(axes: Iterable[str]) -> tuple[str, ...]:
    """Names of joints in the order of the channel; empty where they are but numbers."""
    axes = sorted_axes(axes)
    return () if all(axis.isdigit() for axis in axes) else tuple(axes)


def space_of(channels: dict[str, Array]) -> str:
    """The space that channels live in, for example ``R2``, ``R3xS3`` or ``joint``."""
    factors = []
    if "position_m" in channels:
        factors.append(f"R{channels['position_m'].shape[1]}")
    if "orientation_wxyz" in channels:
        factors.append("S3")
    if "direction_xyz" in channels:
        factors.append("S2")
    if "joints_rad" in channels:
        factors.append("joint")
    return "x".join(factors)


def sorted_axes(axes: Iterable[str]) -> list[str]:
    """Axes in the order of the channel: w, x, y, z; numbers by value; joints as they stand in the file."""
    axes = list(axes)
    if all(axis in UNIT_AXES["orientation_wxyz"] for axis in axes):
        return sorted(axes)
    if all(axis.isdigit() for axis in axes):
        return sorted(axes, key=int)
    return axes
