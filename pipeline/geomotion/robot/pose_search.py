"""Joint positions for one pose: Levenberg–Marquardt within the joint limits.

Against PyBullet's own solver (200 iterations, residual 1e-6) it leaves the simulated arm where it is, keeps the limits,
and converges to rounding instead of to 0.1 mm, which differences of joint positions, and so accelerations and jerks,
would show. It takes as long.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from geomotion.robot.chain import Chain
from geomotion.robot.panda import LIMITS
from geomotion.types import Float

ITERATIONS = 200
CONVERGED_M = 1e-9
STALLED = 1e-5  # relative change of the squared error by a step, below which the pose counts as out of reach
LEVER_M = 0.3  # a radian weighs like that much
DAMPING_M2 = 1e-6
KEEP_FROM_LIMIT_RAD = 0.2  # nearer to a limit than this, the redundant motion leads away from it


def search(
    chain: Chain, target: Float[np.ndarray, "4 4"], start_rad: Float[np.ndarray, " joint"]
) -> Float[np.ndarray, " joint"]:
    """Joint positions within the limits whose pose is nearest to `target` [m].

    Source: Sugihara (2011), Solvability-unconcerned inverse kinematics by the Levenberg–Marquardt method.
    """
    q: Float[np.ndarray, " joint"] = np.clip(start_rad, LIMITS.lower_rad, LIMITS.upper_rad)
    before = np.inf
    for _ in range(ITERATIONS):
        reached, J = chain.pose_and_jacobian(q)
        error = pose_error(reached, target)
        square = float(error @ error)
        if square < CONVERGED_M**2 or abs(before - square) < STALLED * square:
            break
        J[3:] *= LEVER_M
        q, before = _step(q, J, error), square
    return q


def _step(
    q: Float[np.ndarray, " joint"], J: Float[np.ndarray, "6 joint"], error: Float[np.ndarray, "6"]
) -> Float[np.ndarray, " joint"]:
    """One damped step; joints that it would carry beyond a limit stay there, and the others make up for them."""
    lower, upper = LIMITS.lower_rad, LIMITS.upper_rad
    aside = np.maximum(lower + KEEP_FROM_LIMIT_RAD - q, 0) - np.maximum(q - upper + KEEP_FROM_LIMIT_RAD, 0)
    is_free = np.ones(len(q), dtype=bool)
    for _ in range(len(q)):
        K = J * is_free
        damped = K @ K.T + (error @ error / 2 + DAMPING_M2) * np.eye(6)
        moved = q + K.T @ np.linalg.solve(damped, error - K @ aside) + aside * is_free
        beyond = is_free & ((moved < lower) | (moved > upper))
        if not beyond.any():
            break
        is_free &= ~beyond
    kept: Float[np.ndarray, " joint"] = np.clip(moved, lower, upper)
    return kept


def pose_error(reached: Float[np.ndarray, "4 4"], target: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "6"]:
    """What is left to the target: position [m] and rotation vector times the lever [m], in the base frame."""
    turn = Rotation.from_matrix(target[:3, :3] @ reached[:3, :3].T).as_rotvec()
    return np.concatenate([target[:3, 3] - reached[:3, 3], LEVER_M * turn])


def jacobians(chain: Chain, frames: Float[np.ndarray, "frame n 4 4"]) -> Float[np.ndarray, "n 6 joint"]:
    """Of the tip's velocity [m/rad] and of its angular velocity times the lever [m/rad]."""
    axes = np.einsum("fnij,fj->fni", frames[:-1, :, :3, :3], chain.axes)
    arms = frames[-1, :, :3, 3] - frames[:-1, :, :3, 3]
    return np.moveaxis(np.concatenate([np.cross(axes, arms), LEVER_M * axes], axis=2), 0, 2)
