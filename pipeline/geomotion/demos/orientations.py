"""Whether quaternions of one set are all rotations of one motion, written in one order."""

import numpy as np
from numpy.typing import NDArray

from geomotion.demos.demonstrations import Array, Demonstrations, Trajectory
from geomotion.errors import DatasetError

ORIENTATION = "orientation_wxyz"
LARGEST_STEP_RAD = np.radians(120)  # between two samples of one motion
ALIKE_RAD, APART_RAD = np.radians(20), np.radians(60)  # mean orientations of demonstrations of one skill


def check_orientations(demonstrations: Demonstrations) -> None:
    """Refuse orientations that jump, and demonstrations whose scalar part stands last while others have it first.

    The order shows only by comparison: a demonstration is suspected where its mean orientation is far from those of the
    others as it is read, and close to them if it is read as x, y, z, w.

    Raises:
        DatasetError: Naming the demonstration, and what to do.
    """
    if ORIENTATION not in demonstrations.channel_names:
        return
    for number, trajectory in enumerate(demonstrations.trajectories):
        _refuse_jump(demonstrations.name, number, trajectory)
    means = np.stack([_mean(trajectory.channels[ORIENTATION]) for trajectory in demonstrations.trajectories])
    as_read = _typical_angle(means, means)
    scalar_last = _typical_angle(np.roll(means, 1, axis=1), means)
    suspected = np.flatnonzero((as_read > APART_RAD) & (scalar_last < ALIKE_RAD))
    if suspected.size:
        number = int(suspected[0])
        place = f"demonstration {number} ({demonstrations[number].label})".replace(" ()", "")
        raise DatasetError(
            demonstrations.name,
            f"{place}: its quaternions fit those of the others only if they are in the order x, y, z, w; expected "
            f"w, x, y, z. Name the columns by axis (orientation_x, …) or the array orientation_xyzw",
        )


def continuous_in_sign(quaternions: Array, near: Array) -> Array:
    """The same rotations, each quaternion of the sign nearer to the one before it, shape (time, 4).

    Args:
        quaternions: Shape (time, 4).
        near: One that the first is near to, shape (4,).
    """
    turns = np.einsum("ti,ti->t", quaternions, np.concatenate([near[None], quaternions[:-1]]))
    return np.asarray(quaternions * np.cumprod(np.where(turns < 0, -1.0, 1.0))[:, None])


def _refuse_jump(name: str, number: int, trajectory: Trajectory) -> None:
    values = _unit(trajectory.channels[ORIENTATION])
    steps = _angles(values[1:], values[:-1])
    if steps.max() > LARGEST_STEP_RAD:
        row = int(steps.argmax()) + 1
        raise DatasetError(
            name,
            f"demonstration {number}, row {row}: the orientation turns {np.degrees(steps.max()):.0f} degrees in one "
            f"sample; expected rotations of one motion, as unit quaternions w, x, y, z",
        )


def _typical_angle(means: Array, others: Array) -> NDArray[np.float64]:
    """Median angle of each to those of all other demonstrations; 0 for a single one."""
    angles = _angles(means[:, None], others[None])
    return np.array([np.median(np.delete(row, k)) if len(row) > 1 else 0.0 for k, row in enumerate(angles)])


def _angles(first: Array, second: Array) -> Array:
    return np.asarray(2 * np.arccos(np.clip(np.abs((first * second).sum(-1)), 0, 1)))


def _mean(quaternions: Array) -> Array:
    """Of either sign, see :func:`geomotion.lie.rotations.mean_quaternion`."""
    values = _unit(quaternions)
    return np.asarray(np.linalg.eigh(values.T @ values)[1][:, -1])


def _unit(quaternions: Array) -> Array:
    return np.asarray(quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True))
