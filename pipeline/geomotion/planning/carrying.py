"""A skill carried to another start and goal: offsets at both ends that fade along the progress of the motion.

Poses are treated as vectors, and orientations brought back to length one: an offset of zero changes nothing, the pose
at the end where an offset has its full weight is met exactly, and quaternions and directions need no separate rules.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from geomotion.scores.paths import PosePath

SHORTEST_PROGRESS = 1e-2  # between the ends; below it progress does not tell them apart


@dataclass(frozen=True)
class Offsets:
    """What is added at the start and at the goal.

    Attributes:
        start: Difference of positions [m] and orientations, shape (D,).
        goal: The same at the goal.
        start_progress: Progress where the first has its full weight.
        goal_progress: Progress where the second has it.
    """

    start: Float[np.ndarray, " D"]
    goal: Float[np.ndarray, " D"]
    start_progress: float = 0.0
    goal_progress: float = 1.0

    @classmethod
    def between(
        cls, found: PosePath, wanted: PosePath, progress: Float[np.ndarray, " point"], ends: tuple[int, int] = (0, -1)
    ) -> "Offsets":
        """Those that bring two poses of a path to the first and last wanted one."""
        start, goal = (vectors(wanted)[end] - vectors(found)[place] for end, place in zip((0, -1), ends, strict=True))
        return cls(start, goal, float(progress[ends[0]]), float(progress[ends[1]]))

    def carry(self, poses: PosePath, progress: Float[np.ndarray, " point"]) -> PosePath:
        """The poses with their share of both offsets; before and after the ends the shares stay what they are there."""
        whole = self.goal_progress - self.start_progress
        if abs(whole) < SHORTEST_PROGRESS:
            return poses
        done = ((progress - self.start_progress) / whole).clip(0, 1)
        return blended(poses, self.start, self.goal, done)

    def undone(self, poses: PosePath, progress: Float[np.ndarray, " point"]) -> PosePath:
        """The poses with the offsets taken away."""
        opposite = Offsets(-self.start, -self.goal, self.start_progress, self.goal_progress)
        return opposite.carry(poses, progress)


def meet(path: PosePath, ends: PosePath) -> PosePath:
    """Make a path end exactly where it should; what is missing is spread evenly over its length."""
    steps = np.linalg.norm(np.diff(path.position_m, axis=0), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    done = travelled / travelled[-1] if travelled[-1] > 0 else np.linspace(0, 1, len(path))
    found, wanted = vectors(path), vectors(ends)
    return blended(path, wanted[0] - found[0], wanted[-1] - found[-1], done)


def blended(
    poses: PosePath, start: Float[np.ndarray, " D"], goal: Float[np.ndarray, " D"], done: Float[np.ndarray, " point"]
) -> PosePath:
    """Poses plus (1 - done) times one offset and done times the other."""
    moved = vectors(poses) + (1 - done)[:, None] * start + done[:, None] * goal
    return of_vectors(moved, poses.position_m.shape[1])


def vectors(poses: PosePath) -> Float[np.ndarray, "pose D"]:
    """Positions and orientations side by side."""
    return np.concatenate([poses.position_m, poses.orientation], axis=1)


def of_vectors(values: Float[np.ndarray, "pose D"], position_dim: int) -> PosePath:
    """Poses from positions and orientations side by side; the latter are brought to length one."""
    orientation = values[:, position_dim:]
    return PosePath(values[:, :position_dim], orientation / np.linalg.norm(orientation, axis=1, keepdims=True))
