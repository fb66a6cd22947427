"""Scores of a field with conditions, from those under each condition."""

from collections.abc import Sequence

import numpy as np

from geomotion.scores import contraction, reproduction
from geomotion.scores.evaluation import Evaluation
from geomotion.scores.score import Score, max_score, summary_score

OF_GRID_POINT = ("grid_points", *contraction.ARRAYS)


def merged(evaluations: Sequence[Evaluation]) -> Evaluation:
    """All conditions as one evaluation.

    Scores are means over conditions, largest values the largest, smallest the smallest; only those that every
    condition has. Of the arrays, demonstrations with their rollouts and eigenvalues are kept, points of all conditions
    together; others belong to one condition.
    """
    first, *others = evaluations
    names = [name for name in first.scores if all(name in other.scores for other in others)]
    scores = {name: _merged_score([evaluation.scores[name] for evaluation in evaluations]) for name in names}
    omitted = {name: reason for evaluation in evaluations for name, reason in evaluation.omitted.items()}
    return Evaluation(scores, _merged_arrays(evaluations), omitted)


def _merged_score(scores: Sequence[Score]) -> Score:
    first, values = scores[0], [score.value for score in scores]
    note = f"{len(scores)} conditions; {first.note}"
    if first.statistic == "max":
        return max_score(values, first.unit, note)
    if first.statistic == "min":
        return summary_score(min(values), values, first.unit, "min", note)
    statistic = first.statistic if first.statistic in ("mean", "share") else f"mean of {first.statistic}"
    return summary_score(float(np.mean(values)), values, first.unit, statistic, note)


def _merged_arrays(evaluations: Sequence[Evaluation]) -> dict[str, np.ndarray]:
    arrays = {"grid_shape": np.empty(0, dtype=int)} | reproduction.merged_arrays(evaluations)
    for name in OF_GRID_POINT:
        parts = [evaluation.arrays[name] for evaluation in evaluations if name in evaluation.arrays]
        if len(parts) == len(evaluations):
            arrays[name] = np.concatenate(parts)
    return arrays
