"""Lead an arm's hand along poses, from configurations that nearly take them."""

import numpy as np
from scipy.spatial.transform import Rotation

from geomotion.robot.arm import Arm
from geomotion.robot.pose_search import DAMPING_M2, LEVER_M, jacobians
from geomotion.types import Float

ITERATIONS = 6
LARGEST_STEP_RAD = 0.2  # of a joint, in one iteration: configurations are near already
FREE = 6  # joints that it takes to lead a hand anywhere


def can_lead(arm: Arm) -> bool:
    """Whether the arm has joints enough to take any pose nearby."""
    return len(arm.joint_names) >= FREE


def lead(
    arm: Arm,
    joints_rad: Float[np.ndarray, "state joint"],
    positions_m: Float[np.ndarray, "state 3"],
    orientations_wxyz: Float[np.ndarray, "state 4"],
) -> Float[np.ndarray, "state joint"]:
    """Configurations that take poses, or come near them within the limits; redundant joints move as little as they can.

    All at once, by a few damped Gauss-Newton steps from configurations that nearly take the poses.
    """
    targets = Rotation.from_quat(orientations_wxyz, scalar_first=True)
    lower, upper = arm.limits.lower_rad, arm.limits.upper_rad
    joints = np.asarray(joints_rad)
    for _ in range(ITERATIONS):
        frames = arm.chain.frames(joints)
        turn = targets * Rotation.from_matrix(frames[-1, :, :3, :3]).inv()
        error = np.concatenate([positions_m - frames[-1, :, :3, 3], LEVER_M * turn.as_rotvec()], axis=1)
        J = jacobians(arm.chain, frames)
        damping = (np.square(error).sum(axis=1) / 2 + DAMPING_M2)[:, None, None] * np.eye(6)
        step = (J.transpose(0, 2, 1) @ np.linalg.solve(J @ J.transpose(0, 2, 1) + damping, error[:, :, None]))[:, :, 0]
        joints = np.clip(joints + step.clip(-LARGEST_STEP_RAD, LARGEST_STEP_RAD), lower, upper)
    return joints
