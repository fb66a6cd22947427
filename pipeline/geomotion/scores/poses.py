"""How well poses are reproduced: positions and orientations apart, beside the mean of the demonstrations."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geomotion.scores.evaluation import Evaluation
from geomotion.scores.paths import PoseDistance, PosePath, mean_path, pose_dtwd
from geomotion.scores.score import Score, mean_score

PARTS = (("position", "mm", 1000.0), ("orientation", "deg", math.degrees(1.0)))


@dataclass(frozen=True)
class JudgedPoses:
    """One demonstration with what the model makes of it.

    Attributes:
        demonstrated: Its poses.
        rollout: The model's, from the same start at the same times.
        is_trained: Whether the model was fitted to it.
    """

    demonstrated: PosePath
    rollout: PosePath
    is_trained: bool


def judge_poses(judged: Sequence[JudgedPoses]) -> Evaluation:
    """Scores ``train.position_…``, ``train.orientation_…`` and the same of held-out demonstrations.

    A baseline is the mean pose of the training demonstrations at equal shares of their durations, which knows neither
    start nor end of the demonstration that it is compared with.
    """
    trained = [one for one in judged if one.is_trained]
    average = mean_path([one.demonstrated for one in trained], max(len(one.demonstrated) for one in trained))
    scores: dict[str, Score] = {}
    for subset, members in (("train", trained), ("heldout", [one for one in judged if not one.is_trained])):
        if members:
            scores |= _subset(subset, members, average)
    return Evaluation(scores)


def _subset(subset: str, members: Sequence[JudgedPoses], average: PosePath) -> dict[str, Score]:
    reached = [pose_dtwd(one.rollout, one.demonstrated) for one in members]
    averaged = [pose_dtwd(average, one.demonstrated) for one in members]
    ends = [PoseDistance(*map(float, _at_end(one))) for one in members]
    scores = {}
    for part, unit, factor in PARTS:
        values, baseline, end = (
            np.array([factor * getattr(one, part) for one in distances]) for distances in (reached, averaged, ends)
        )
        scores[f"{subset}.{part}_dtwd"] = mean_score(values, unit, "Sec. 6.4, per point, both directions")
        scores[f"{subset}.{part}_dtwd_of_averaged_demo"] = mean_score(
            baseline, unit, "baseline: mean pose of the training demonstrations at equal shares of duration"
        )
        scores[f"{subset}.{part}_ratio_to_averaged_demo"] = Score(
            float(values.mean() / baseline.mean()) if baseline.mean() > 0 else math.nan,
            "1",
            len(members),
            note=f"{subset}.{part}_dtwd / {subset}.{part}_dtwd_of_averaged_demo",
        )
        scores[f"{subset}.{part}_end_error"] = mean_score(end, unit, "at the demonstration's own duration")
    return scores


def _at_end(one: JudgedPoses) -> tuple[float, float]:
    apart_m, apart_rad = one.rollout[-1:].residuals(one.demonstrated[-1:])
    return float(apart_m[0]), float(apart_rad[0])
