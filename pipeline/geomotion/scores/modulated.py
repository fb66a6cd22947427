"""What obstacles leave of a field's contraction, and whether motions still get past them: measured, proven is neither.

That a contracting field stays contracting when it is modulated is not proven, in any metric: in front of an obstacle
motions part.
"""

import numpy as np
import torch

from geomotion.dynamics.fields import Chart
from geomotion.obstacles.modulation import ModulatedField
from geomotion.obstacles.obstacle import clearance
from geomotion.scores.contraction import contraction_scores
from geomotion.scores.evaluation import Evaluation, Roll
from geomotion.scores.jacobians import eigenvalues_in_metric, field_jacobian, symmetric_eigenvalues
from geomotion.scores.nearby import ToClaimed, distance_scores, nearby_distances
from geomotion.scores.score import Score, share_score
from geomotion.types import Bool, Float, States, Tensor, Times, Trajectories


def judge_modulated_contraction(field: ModulatedField, chart: Chart, points: States, note: str) -> Evaluation:
    """Largest eigenvalues of the modulated field where obstacles are at its time, at the points outside of them.

    Args:
        field: The field among obstacles.
        chart: ψ: contraction of the field in free space is claimed in its metric.
        points: Where to judge it [m].
        note: How the points were chosen.

    Source:
        Thesis Sec. 5.4, Eq. (2.15).
    """
    points = points[is_free(field, points)]
    if len(points) == 0:
        return Evaluation(omitted={"obstacles.contraction": "no point of the grid is outside of the obstacles"})
    spectra = {
        "true": (symmetric_eigenvalues(field_jacobian(field, points)), "robot coordinates"),
        "claimed": (eigenvalues_in_metric(field, chart, points), "the metric in which contraction is claimed"),
    }
    return Evaluation(
        {
            f"obstacles.contraction.{name}.{quantity}": score
            for name, (eigenvalues, metric) in spectra.items()
            for quantity, score in contraction_scores(
                eigenvalues.detach().double().numpy(), f"among obstacles, true Jacobian, {metric}; {note}"
            ).items()
        }
    )


def judge_modulated_nearby(
    roll: Roll, to_claimed: ToClaimed, starts: Float[np.ndarray, "start D"], times_s: Float[np.ndarray, " time"]
) -> Evaluation:
    """How far rollouts from nearby starts part among obstacles.

    Args:
        roll: Trajectories of the modulated field.
        to_claimed: ψ.
        starts: Nearby starts outside of obstacles [m].
        times_s: Times after the start [s].
    """
    if len(starts) < 2:
        return Evaluation(omitted={"obstacles.nearby": "distances need two starts outside of the obstacles"})
    euclidean, claimed = nearby_distances(roll, to_claimed, starts, times_s)
    note = f"{len(starts)} rollouts among obstacles, {len(times_s)} times over {times_s[-1]:.3g} s"
    return Evaluation(
        distance_scores(euclidean, "obstacles.nearby.euclidean", note)
        | distance_scores(claimed, "obstacles.nearby.claimed", note)
    )


def judge_passage(
    field: ModulatedField,
    states: Trajectories,
    times: Times,
    goal: Float[Tensor, " D"],
    tolerance_m: float,
    note: str,
) -> Evaluation:
    """Whether rollouts stay outside of obstacles and get to the goal.

    Args:
        field: The field among obstacles.
        states: Trajectories that start outside, shape (start, time, D) [m].
        times: [s].
        goal: [m].
        tolerance_m: How near counts as there.
        note: How the starts were chosen.
    """
    never = (states[:, -1] - goal).norm(dim=-1) > tolerance_m
    gaps = 1000 * clearance(field.obstacles, field.position(states), times).double().numpy()
    smallest = Score(float(gaps.min()), "mm", len(gaps), statistic="min", note=f"at output times; {note}")
    never_note = f"not within {1000 * tolerance_m:.3g} mm of the goal after {float(times[-1]):.3g} s; {note}"
    return Evaluation(
        {
            "obstacles.passage.never_reached": share_score(never.numpy(), never_note),
            "obstacles.passage.clearance": smallest,
        }
    )


def is_free(field: ModulatedField, points: States) -> Bool[Tensor, " point"]:
    """Which points are outside of all obstacles at time zero."""
    return torch.stack([obstacle.level(field.position(points)) > 1 for obstacle in field.obstacles]).all(dim=0)
