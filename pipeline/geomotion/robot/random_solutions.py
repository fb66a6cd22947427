"""Random joint positions for poses of the Panda: what inverse kinematics may answer, where nothing says which.

A pose leaves a redundant arm infinitely many, on several branches. Each search begins at joint positions drawn evenly
from within the limits, and ends at a solution near them; all poses and starts are searched at once.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from geomotion.errors import InvalidSetting
from geomotion.robot import panda
from geomotion.robot.chain import Chain, panda_chain
from geomotion.robot.inverse_kinematics import ORIENTATION_TOLERANCE_RAD, POSITION_TOLERANCE_M, pose_transforms
from geomotion.robot.pose_search import DAMPING_M2, LEVER_M, jacobians
from geomotion.types import Bool, Float

ITERATIONS = 50
ROUNDS = 4  # of new starts for those searches that ended elsewhere
CONVERGED_M = 1e-5  # of the error in which a radian counts as 0.3 m

Joints = Float[np.ndarray, "n joint"]
Transforms = Float[np.ndarray, "n 4 4"]


@dataclass(frozen=True)
class RandomSolutions:
    """Several joint positions for each of some poses.

    Attributes:
        joints_rad: Within the joint limits [rad].
        reached: Whether they take the pose within 1 mm and 0.5°.
    """

    joints_rad: Float[np.ndarray, "pose solution joint"]
    reached: Bool[np.ndarray, "pose solution"]


def random_solutions(
    positions_m: Float[np.ndarray, "pose 3"],
    orientations_wxyz: Float[np.ndarray, "pose 4"],
    count: int,
    frame: panda.Frame = "grasp_target",
    seed: int = 0,
) -> RandomSolutions:
    """Draw solutions of inverse kinematics.

    Args:
        positions_m: In the base frame [m].
        orientations_wxyz: Unit quaternions; the sign does not matter.
        count: Solutions of each pose.
        frame: Which frame of the arm takes the poses.
        seed: Of the starts.

    Raises:
        ShapeMismatch: If there are no poses, or not one orientation per position.
        InvalidSetting: If a number is not finite, a quaternion is not of unit length, or no solution is asked for.
    """
    if count < 1:
        raise InvalidSetting("count", count, "one solution or more")
    targets, chain = np.repeat(pose_transforms(positions_m, orientations_wxyz), count, axis=0), panda_chain(frame)
    draw, limits = np.random.default_rng(seed), panda.LIMITS
    joints = np.zeros((len(targets), len(limits.lower_rad)))
    is_open = np.ones(len(targets), dtype=bool)
    for _ in range(ROUNDS):
        wanted = targets[is_open]
        found = _search(chain, wanted, draw.uniform(limits.lower_rad, limits.upper_rad, (len(wanted), joints.shape[1])))
        joints[is_open] = found
        is_open[is_open] = ~_reaches(chain, wanted, found)
        if not is_open.any():
            break
    shape = len(positions_m), count
    return RandomSolutions(joints.reshape(*shape, -1), ~is_open.reshape(shape))


def _search(chain: Chain, targets: Transforms, starts_rad: Joints) -> Joints:
    """Levenberg–Marquardt as in :func:`pose_search.search`, for many poses at once, which end at different times."""
    joints = starts_rad.copy()
    left = np.arange(len(joints))
    for _ in range(ITERATIONS):
        frames = chain.frames(joints[left])
        error = _pose_error(frames[-1], targets[left])
        is_far = np.linalg.norm(error, axis=1) > CONVERGED_M
        left, frames, error = left[is_far], frames[:, is_far], error[is_far]
        if len(left) == 0:
            break
        joints[left] = _step(joints[left], jacobians(chain, frames), error)
    return joints


def _step(joints: Joints, J: Float[np.ndarray, "n 6 joint"], error: Float[np.ndarray, "n 6"]) -> Joints:
    """One damped step; joints that it would carry beyond a limit stay there, and the others make up for them."""
    lower, upper = panda.LIMITS.lower_rad, panda.LIMITS.upper_rad
    damping = (np.einsum("ni,ni->n", error, error) / 2 + DAMPING_M2)[:, None, None] * np.eye(6)
    is_free = np.ones(joints.shape, dtype=bool)
    for _ in range(2):
        K = J * is_free[:, None]
        step = np.einsum("nij,ni->nj", K, np.linalg.solve(K @ K.swapaxes(1, 2) + damping, error[..., None])[..., 0])
        is_free &= (joints + step >= lower) & (joints + step <= upper)
    return np.asarray(np.clip(joints + step, lower, upper))


def _pose_error(reached: Transforms, targets: Transforms) -> Float[np.ndarray, "n 6"]:
    turns = Rotation.from_matrix(targets[:, :3, :3] @ reached[:, :3, :3].swapaxes(1, 2)).as_rotvec()
    return np.concatenate([targets[:, :3, 3] - reached[:, :3, 3], LEVER_M * turns], axis=1)


def _reaches(chain: Chain, targets: Transforms, joints_rad: Joints) -> Bool[np.ndarray, " n"]:
    error = _pose_error(chain.frames(joints_rad)[-1], targets)
    position_m, angle_rad = np.linalg.norm(error[:, :3], axis=1), np.linalg.norm(error[:, 3:], axis=1) / LEVER_M
    return np.asarray((position_m <= POSITION_TOLERANCE_M) & (angle_rad <= ORIENTATION_TOLERANCE_RAD))
