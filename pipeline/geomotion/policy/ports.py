"""Names, sizes and units of what goes into a policy and of what comes out."""

from dataclasses import dataclass
from enum import IntEnum

STATE, POSITION, ORIENTATION, JOINTS = "state_m", "position_m", "orientation_wxyz", "joints_rad"
CONDITION, ELAPSED = "condition", "elapsed_s"
OBSTACLE_CENTRE, OBSTACLE_RADIUS = "obstacle_centre_m", "obstacle_radius_m"
OBSTACLE_VELOCITY = "obstacle_velocity_m_per_s"
TRANSVERSE_RATE = "transverse_rate_per_duration"
START = "start_"  # before the name of a measured input: what that was when the motion began
VELOCITY, JOINT_VELOCITY, OMEGA = "velocity_m_per_s", "joint_velocity_rad_per_s", "angular_velocity_rad_per_s"
STATUS, OFF_MANIFOLD, SAFETY = "status", "off_manifold_m", "safety_distance"


class Status(IntEnum):
    """How far the velocities of a policy can be trusted."""

    ok = 0
    outside = 1  # of the range of the demonstrations: the velocity is an extrapolation
    undefined = 2  # what was measured is not finite, or no rotation: the velocity is zero


@dataclass(frozen=True)
class Input:
    """One input of a policy.

    Attributes:
        name: With its unit.
        width: Columns.
        unit: Of all of them, or one for each kind.
        default: The value where it is left out, one row for all states; None where it has to be given, a row for each.
    """

    name: str
    width: int
    unit: str
    default: tuple[float, ...] | None = None


@dataclass(frozen=True)
class Output:
    """One output of a policy.

    Attributes:
        name: With its unit.
        width: Columns; None for one number a state.
        unit: Of all of them.
    """

    name: str
    width: int | None
    unit: str
