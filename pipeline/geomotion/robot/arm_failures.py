"""How often an arm touches obstacles that its hand keeps clear of, where inverse kinematics decides about the rest.

Source: Thesis Sec. 4.4, Fig. 4.4.
"""

from dataclasses import dataclass

import numpy as np

from geomotion.robot import panda
from geomotion.robot.random_solutions import random_solutions
from geomotion.robot.scene import ArmScene
from geomotion.types import Bool, Float, Int


@dataclass(frozen=True)
class ArmFailures:
    """What became of random joint positions for some poses.

    Attributes:
        solutions: How many of them take the pose.
        touching: How many of those touch an obstacle.
    """

    solutions: Int[np.ndarray, " pose"]
    touching: Int[np.ndarray, " pose"]

    @property
    def share(self) -> Float[np.ndarray, " pose"]:
        """Of the solutions that touch an obstacle; not a number where there is no solution."""
        return np.where(self.solutions > 0, self.touching / np.maximum(self.solutions, 1), np.nan)


def arm_failures(
    scene: ArmScene,
    positions_m: Float[np.ndarray, "pose 3"],
    orientations_wxyz: Float[np.ndarray, "pose 4"],
    count: int,
    frame: panda.Frame = "grasp_target",
    seed: int = 0,
) -> ArmFailures:
    """Draw joint positions for poses, and look in the simulator which of them touch an obstacle, with any link.

    Args:
        scene: The Panda among its obstacles; left in any configuration.
        positions_m: Of the end effector [m].
        orientations_wxyz: Unit quaternions; the sign does not matter.
        count: Joint positions drawn for each pose, see :func:`random_solutions.random_solutions`.
        frame: Which frame of the arm takes the poses.
        seed: Of the draw.

    Raises:
        ShapeMismatch: If there are no poses, or not one orientation per position.
        InvalidSetting: If a number is not finite, a quaternion is not of unit length, or no solution is asked for.
    """
    found = random_solutions(positions_m, orientations_wxyz, count, frame, seed)
    touches = np.zeros(found.reached.shape, dtype=bool)
    touches[found.reached] = _touch(scene, found.joints_rad[found.reached])
    return ArmFailures(found.reached.sum(axis=1), touches.sum(axis=1))


def _touch(scene: ArmScene, joints_rad: Float[np.ndarray, "n joint"]) -> Bool[np.ndarray, " n"]:
    touching = np.zeros(len(joints_rad), dtype=bool)
    for row, joints in enumerate(joints_rad):
        scene.set_joints(joints)
        touching[row] = any(scene.clearances_from(name, 0.0) for name in scene.obstacles)
    return touching
