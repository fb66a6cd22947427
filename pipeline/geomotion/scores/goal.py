"""Which starts reach the goal."""

import numpy as np
from jaxtyping import Float

from geomotion.scores.evaluation import Evaluation, Roll
from geomotion.scores.grids import Sample
from geomotion.scores.score import share_score


def judge_goal(
    roll: Roll,
    goal: Float[np.ndarray, " D"],
    starts: Sample,
    times_s: Float[np.ndarray, " time"],
    tolerance_m: float,
) -> Evaluation:
    """Share of starts whose rollout is not at the goal at the end of the given times.

    Rollouts that stop elsewhere (spurious equilibria), circle, are too slow or diverge all count.
    """
    final = roll(starts.points, times_s)[:, -1]
    reached = np.linalg.norm(final - goal, axis=1) <= tolerance_m  # false for states that are not finite
    note = (
        f"{int((~reached).sum())} of {len(reached)} starts not within {1000 * tolerance_m:.3g} mm of the goal after "
        f"{times_s[-1]:.3g} s; {starts.note}"
    )
    return Evaluation(
        {"goal.never_reached": share_score(~reached, note)},
        {"goal": goal, "goal_starts": starts.points, "goal_reached": reached},
    )
