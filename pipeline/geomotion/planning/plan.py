"""What comes out of planning: a path with what is known about it, or the reason why there is none."""

from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np
from jaxtyping import Float

from geomotion.planning.manifold import DecodedPath


class PlanStatus(Enum):
    """How planning ended; only `found` comes with a path to execute."""

    found = "found"
    start_outside = "the start is outside the demonstrated region"
    goal_outside = "the goal is outside the demonstrated region"
    start_covered = "an obstacle covers the start"
    goal_covered = "an obstacle covers the goal"
    blocked = "obstacles block every way inside the demonstrations"
    cap_reached = "start and goal are joined only by leaving the demonstrations farther than allowed"
    crosses = "the way crosses a region without data"
    joint_limit = "a joint would go beyond its limit"
    self_collision = "the arm would collide with itself"
    touches = "a link would come too near to an obstacle"


@dataclass(frozen=True)
class PathScores:
    """What is known about a planned path.

    Attributes:
        length: Riemannian length of the path, in the metric that was planned in.
        graph_length: The same of the graph path that it was fitted to.
        energy: Energy in the thesis' metric, without conformal factor.
        line_energy: Energy of the straight latent line between the same ends.
        clearance_m: Guaranteed distance between the robot and obstacles along the path [m]; infinite without obstacles.
        apart_m: Farthest distance of the end effector to the demonstrations [m].
        apart_rad: Largest angle to the orientations, or distance to the configurations, demonstrated nearby [rad].
        start_residual_m: How far the manifold is from the wanted start [m]; bridged by carrying the path there.
        start_residual_rad: The same in angles [rad].
        goal_residual_m: The same at the goal.
        goal_residual_rad: The same at the goal.
    """

    length: float
    graph_length: float
    energy: float
    line_energy: float
    clearance_m: float
    apart_m: float
    apart_rad: float
    start_residual_m: float = 0.0
    start_residual_rad: float = 0.0
    goal_residual_m: float = 0.0
    goal_residual_rad: float = 0.0


@dataclass(frozen=True)
class Plan:
    """Outcome of planning.

    Attributes:
        status: How it ended.
        reason: One sentence for people.
        codes: Latent path, shape (point, d); empty if there is none.
        path: States to execute and their progress; None if there is none.
        scores: What is known about it; None if there is none.
        blocking: Names of the obstacles in the way, where there is none.
    """

    status: PlanStatus
    reason: str
    codes: Float[np.ndarray, "point d"]
    path: DecodedPath | None = None
    scores: PathScores | None = None
    blocking: tuple[str, ...] = field(default=())

    @property
    def found(self) -> bool:
        """Whether there is a path to execute."""
        return self.status is PlanStatus.found

    def as_dict(self) -> dict[str, Any]:
        """Everything but the points, as JSON types."""
        scores = None
        if self.scores is not None:
            scores = {name: _finite(value) for name, value in vars(self.scores).items()}
        return {
            "status": self.status.name,
            "reason": self.reason,
            "blocking": list(self.blocking),
            "points": len(self.codes),
            "scores": scores,
        }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
