"""A skill carried to another start and goal: offsets at both ends that fade along the progress of the motion.

Poses and configurations are treated as vectors, and orientations brought back to length one: an offset of zero changes
nothing, and the state at the end where an offset has its full weight is met exactly.
"""

from dataclasses import dataclass
from typing import TypeVar, cast

import numpy as np
from jaxtyping import Float

from geomotion.scores.configurations import ConfigurationPath
from geomotion.scores.paths import MotionPath

P = TypeVar("P", bound=MotionPath)
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
        cls,
        found: MotionPath,
        wanted: MotionPath,
        progress: Float[np.ndarray, " point"],
        ends: tuple[int, int] = (0, -1),
    ) -> "Offsets":
        """Those that bring two states of a path to the first and last wanted one."""
        start, goal = (wanted.vectors[end] - found.vectors[place] for end, place in zip((0, -1), ends, strict=True))
        return cls(start, goal, float(progress[ends[0]]), float(progress[ends[1]]))

    def carry(self, states: P, progress: Float[np.ndarray, " point"]) -> P:
        """The states with their share of both offsets; before and after the ends the shares stay as they are there."""
        whole = self.goal_progress - self.start_progress
        if abs(whole) < SHORTEST_PROGRESS:
            return states
        done = ((progress - self.start_progress) / whole).clip(0, 1)
        return blended(states, self.start, self.goal, done)

    def undone(self, states: P, progress: Float[np.ndarray, " point"]) -> P:
        """The states with the offsets taken away."""
        opposite = Offsets(-self.start, -self.goal, self.start_progress, self.goal_progress)
        return opposite.carry(states, progress)


def carried_to(path: P, ends: P, progress: Float[np.ndarray, " point"], offsets: "Offsets | None" = None) -> P:
    """A path carried to other ends; configurations such that the end effector is carried as poses are.

    What joints add up to at the end effector is no matter of offsets: where these alone are spread over the joints, the
    hand turns on the way as no demonstration does. It is led along the carried poses instead, and joints that are left
    free keep to their own offsets.

    Args:
        path: From about where it should begin to about where it should end.
        ends: Where it should begin and end.
        progress: Of the motion, along the path.
        offsets: Of the states, where they are known; those between the ends of the path and the wanted ones if omitted.
    """
    spread = Offsets.between(path, ends, progress) if offsets is None else offsets
    carried = spread.carry(path, progress)
    if isinstance(path, ConfigurationPath) and isinstance(ends, ConfigurationPath):
        wanted = ends.hand.with_signs_of(path.hand.with_vectors(path.hand.vectors[[0, -1]]))
        hand = Offsets.between(path.hand, wanted, progress).carry(path.hand, progress)
        carried = cast(P, cast(ConfigurationPath, carried).led_along(hand))
    return meet(carried, ends)


def meet(path: P, ends: P) -> P:
    """Make a path end exactly where it should; what is missing is spread evenly over its length."""
    steps = np.linalg.norm(np.diff(path.position_m, axis=0), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    done = travelled / travelled[-1] if travelled[-1] > 0 else np.linspace(0, 1, len(path))
    found, wanted = path.vectors, ends.vectors
    return blended(path, wanted[0] - found[0], wanted[-1] - found[-1], done)


def blended(
    states: P, start: Float[np.ndarray, " D"], goal: Float[np.ndarray, " D"], done: Float[np.ndarray, " point"]
) -> P:
    """States plus (1 - done) times one offset and done times the other."""
    return states.with_vectors(states.vectors + (1 - done)[:, None] * start + done[:, None] * goal)
