"""Demonstrations as the states that a manifold is learned of."""

from geomotion import arms
from geomotion import config as schema
from geomotion.demos.demonstrations import Demonstrations
from geomotion.demos.joints import joint_paths
from geomotion.demos.poses import pose_paths
from geomotion.scores.paths import MotionPath
from geomotion.training.configurations import configurations

JOINTS = "joint"  # space of demonstrations of joints alone


def is_of_joints(wanted: schema.Space | None, demonstrations: Demonstrations) -> bool:
    """Whether a manifold of configurations is asked for; unless it is said, where the demonstrations are of joints."""
    if wanted is None:
        return demonstrations.space == JOINTS
    return wanted is schema.Space.joint


def state_paths(demonstrations: Demonstrations, points: int, arm: schema.ArmConfig | None) -> list[MotionPath]:
    """All demonstrations with as many states each, even in time: configurations of an arm, or poses if there is none.

    Raises:
        DatasetError: If the demonstrations do not hold what is asked for, or do not fit the arm.
    """
    if arm is None:
        return [*pose_paths(demonstrations, points)]
    built = arms.build(arm)
    found = joint_paths(demonstrations, built.joint_names, built.limits, points)
    return [configurations(joints_rad, built) for joints_rad in found]
