"""Whether motions stay near the demonstrations and out of obstacles, with a safety region and without (Sec. 6.3)."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from geomotion.obstacles.safe_field import SafeField
from geomotion.scores.contraction import contraction_scores
from geomotion.scores.evaluation import Evaluation
from geomotion.scores.jacobians import field_jacobian, symmetric_eigenvalues
from geomotion.scores.score import Score, share_score
from geomotion.types import States


@dataclass(frozen=True)
class Passage:
    """Rollouts from the same latent starts, one row a start.

    Attributes:
        left_support: Whether they are outside of the support at any time.
        clearance_m: Their smallest distance to an obstacle, negative inside; infinite without obstacles [m].
        to_goal_m: Their distance to the goal at the end [m].
    """

    left_support: Bool[np.ndarray, " start"]
    clearance_m: Float[np.ndarray, " start"]
    to_goal_m: Float[np.ndarray, " start"]


def judge_passages(with_region: Passage, without: Passage, tolerance_m: float, note: str) -> Evaluation:
    """Shares of starts that leave the support, enter an obstacle, or never get to the goal.

    Args:
        with_region: Rollouts of the modulated field.
        without: Those of the field as it was learned.
        tolerance_m: How near to the goal counts as there [m].
        note: How the starts were chosen and for how long they were followed.
    """
    scores: dict[str, Score] = {}
    has_obstacles = bool(np.isfinite(with_region.clearance_m).any())
    for suffix, passage in (("", with_region), ("_without_region", without)):
        scores[f"safety.left_support{suffix}"] = share_score(passage.left_support, note)
        if has_obstacles:
            scores[f"safety.entered_obstacle{suffix}"] = share_score(passage.clearance_m < 0, note)
            clearance = 1000 * passage.clearance_m
            scores[f"safety.clearance{suffix}"] = Score(
                float(clearance.min()), "mm", len(clearance), statistic="min", note=f"at the ends of steps; {note}"
            )
        never = f"not within {1000 * tolerance_m:.3g} mm of the goal at the end; {note}"
        scores[f"safety.never_reached{suffix}"] = share_score(passage.to_goal_m > tolerance_m, never)
    return Evaluation(scores)


def judge_safe_contraction(field: SafeField, points: States, time_unit_s: float, note: str) -> Evaluation:
    """Contraction that is left in the latent metric, in which that of the field without the region is claimed.

    Args:
        field: The modulated latent field.
        points: Latent states in the region.
        time_unit_s: Of the latent field [s].
        note: How the points were chosen.

    Source:
        Thesis Eq. (2.15).
    """
    eigenvalues = symmetric_eigenvalues(field_jacobian(field, points)).detach().double().numpy() / time_unit_s
    measured = f"in the region, true Jacobian, latent coordinates; measured, not proven; {note}"
    scores = contraction_scores(eigenvalues, measured)
    return Evaluation({f"safety.contraction.{name}": score for name, score in scores.items()})
