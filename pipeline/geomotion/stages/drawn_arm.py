"""An arm in some of its configurations, for pictures."""

from collections.abc import Mapping, Sequence

import numpy as np

from geomotion import arms
from geomotion import config as schema
from geomotion.figures.joints import JointAxes
from geomotion.figures.plan_picture import ArmPoses, DrawnArm
from geomotion.robot.arm import Arm
from geomotion.scores.paths import MotionPath

POSES = 10  # along each path


def joint_axes(config: schema.ArmConfig) -> JointAxes:
    """Names and limits of an arm's joints."""
    arm = arms.build(config)
    return JointAxes(arm.joint_names, arm.limits.lower_rad, arm.limits.upper_rad)


def drawn_arm(
    config: schema.ArmConfig, paths: Sequence[MotionPath], demonstrated: Mapping[int, MotionPath]
) -> DrawnArm:
    """The arm along paths of its configurations.

    Args:
        config: Which arm.
        paths: Planned legs.
        demonstrated: One demonstration of each group, by group.
    """
    arm = arms.build(config)
    along = [_poses(arm, path) for path in paths]
    return DrawnArm(
        joint_axes(config), along, {group: _poses(arm, path) for group, path in sorted(demonstrated.items())}
    )


def _poses(arm: Arm, path: MotionPath) -> ArmPoses:
    chosen = np.unique(np.linspace(0, len(path) - 1, POSES).round().astype(int))
    return arm.chain.points(path.vectors[chosen], arm.joint_points())
