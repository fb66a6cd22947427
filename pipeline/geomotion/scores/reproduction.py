"""How well rollouts from the demonstrations' own starts reproduce them, beside what repetitions of people reach."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np
from jaxtyping import Float

from geomotion.scores import baselines, curves
from geomotion.scores.evaluation import Evaluation, Unit
from geomotion.scores.score import Score, mean_score, summary_score


@dataclass(frozen=True)
class Judged:
    """One demonstration with what the model makes of it.

    Attributes:
        time_s: Time after the start [s].
        states: Demonstrated states [m].
        velocities: Their velocities [m/s].
        rollout: The model's states at the same times, from the demonstration's own start [m].
        predicted_velocities: The model's velocities at the demonstrated states [m/s].
        is_trained: Whether the model was fitted to it.
    """

    time_s: Float[np.ndarray, " time"]
    states: Float[np.ndarray, "time D"]
    velocities: Float[np.ndarray, "time D"]
    rollout: Float[np.ndarray, "time D"]
    predicted_velocities: Float[np.ndarray, "time D"]
    is_trained: bool


ARRAYS = ("demo", "rollout", "time", "set")  # of each demonstration, with its number behind the name
CURVE_SCORES = {
    "dtwd_per_point": "Sec. 6.4, each direction divided by its number of points",
    "dtwd_sum": "Sec. 6.4, summed over the points of both curves",
    "dtw": "monotone, mean along the path",
    "dtw_sum": "monotone, sum along the path",
    "frechet": "discrete",
    "start_error": "jump between the given start and the first state",
    "end_point_error": "at the demonstration's own duration",
    "time_aligned_rmse": "at equal times",
}


def curve_distances(rollout: curves.Curve, states: curves.Curve) -> dict[str, float]:
    """Every distance of :data:`CURVE_SCORES` between a rollout and its demonstration [m]."""
    alignment = curves.dynamic_time_warping(rollout, states)
    return {
        "dtwd_per_point": curves.dtwd_per_point(rollout, states),
        "dtwd_sum": curves.dtwd_sum(rollout, states),
        "dtw": alignment.mean,
        "dtw_sum": alignment.sum,
        "frechet": curves.discrete_frechet(rollout, states),
        "start_error": curves.start_error(rollout, states),
        "end_point_error": curves.end_point_error(rollout, states),
        "time_aligned_rmse": curves.root_mean_square_error(rollout, states),
    }


def judge_reproduction(judged: Sequence[Judged], unit: Unit) -> Evaluation:
    """Scores of trained demonstrations (``train.``) and of held-out ones (``heldout.``), each with its baselines.

    Args:
        judged: Trained demonstrations, at least one, and held-out ones, if any.
        unit: Unit in which distances are reported.
    """
    trained = [one for one in judged if one.is_trained]
    heldout = [one for one in judged if not one.is_trained]
    scores = _subset_scores("train", trained, unit)
    omitted = {}
    if len(trained) > 1:
        scores |= _train_baselines(trained, scores["train.dtwd_per_point"], unit)
    else:
        omitted["train.dtwd_ratio"] = "baselines need at least two training demonstrations"
    if heldout:
        scores |= _subset_scores("heldout", heldout, unit)
        scores |= _heldout_baselines(heldout, trained, scores["heldout.dtwd_per_point"], unit)
    else:
        omitted["heldout"] = "no held-out demonstration is judged"
    return Evaluation(scores, _arrays([*trained, *heldout]), omitted)


def _subset_scores(subset: str, judged: Sequence[Judged], unit: Unit) -> dict[str, Score]:
    lengths = sorted({len(one.time_s) for one in judged})
    points = f"{lengths[0]} points" if len(lengths) == 1 else f"{lengths[0]} to {lengths[-1]} points"
    distances = [curve_distances(one.rollout, one.states) for one in judged]
    scores = {}
    for name, meaning in CURVE_SCORES.items():
        values = [unit.per_state_unit * single[name] for single in distances]
        scores[f"{subset}.{name}"] = mean_score(values, unit.name, f"{meaning}; {points} a curve, unscaled")
    predictions = [(one.predicted_velocities, one.velocities) for one in judged]
    scores[f"{subset}.velocity_rmse"] = _pooled(
        curves.root_mean_square_error,
        [(unit.per_state_unit * predicted, unit.per_state_unit * recorded) for predicted, recorded in predictions],
        f"{unit.name}/s",
        "on the demonstrated states",
    )
    scores[f"{subset}.relative_velocity_error"] = _pooled(
        curves.relative_error, predictions, "1", "sqrt(mean|v - v'|^2 / mean|v|^2) on the demonstrated states"
    )
    return scores


def _train_baselines(trained: Sequence[Judged], reached: Score, unit: Unit) -> dict[str, Score]:
    demos = [one.states for one in trained]
    between = unit.per_state_unit * baselines.distances_between(demos)
    nearest = unit.per_state_unit * baselines.distances_to_nearest(demos, demos)
    predictions = []
    for left_out in trained:
        others = [one for one in trained if one is not left_out]
        predictions.append((_nearest_velocities(left_out, others), left_out.velocities))
    return {
        "train.dtwd_ratio": _ratio(
            reached, float(between.mean()), "train.dtwd_per_point / train.dtwd_between_demos"
        ),
        "train.dtwd_between_demos": mean_score(between, unit.name, "baseline: every pair of training demonstrations"),
        "train.dtwd_to_nearest_demo": mean_score(
            nearest, unit.name, "baseline: the nearest other training demonstration in place of the rollout"
        ),
        "train.dtwd_of_averaged_demo": _averaged_demo_score(trained, trained, unit),
        "train.nearest_neighbour_velocity_error": _pooled(
            curves.relative_error, predictions, "1", "baseline: nearest state of the other training demonstrations"
        ),
    }  # fmt: skip


def _heldout_baselines(
    heldout: Sequence[Judged], trained: Sequence[Judged], reached: Score, unit: Unit
) -> dict[str, Score]:
    nearest = unit.per_state_unit * baselines.distances_to_nearest(
        [one.states for one in heldout], [one.states for one in trained]
    )
    predictions = [(_nearest_velocities(one, trained), one.velocities) for one in heldout]
    return {
        "heldout.ratio_to_nearest_demo": _ratio(
            reached, float(nearest.mean()), "heldout.dtwd_per_point / heldout.dtwd_to_nearest_demo"
        ),
        "heldout.dtwd_to_nearest_demo": mean_score(
            nearest, unit.name, "baseline: the nearest training demonstration in place of the rollout"
        ),
        "heldout.dtwd_of_averaged_demo": _averaged_demo_score(heldout, trained, unit),
        "heldout.nearest_neighbour_velocity_error": _pooled(
            curves.relative_error, predictions, "1", "baseline: nearest state of the training demonstrations"
        ),
    }  # fmt: skip


def _ratio(reached: Score, baseline: float, note: str) -> Score:
    """A distance as a multiple of a baseline; not finite where demonstrations do not differ."""
    unit = baseline or math.nan
    return Score(reached.value / unit, "1", reached.count, reached.spread / unit, note=note)


def _averaged_demo_score(judged: Sequence[Judged], trained: Sequence[Judged], unit: Unit) -> Score:
    average = baselines.averaged_curve([one.states for one in trained], [one.time_s for one in trained])
    values = [unit.per_state_unit * curves.dtwd_per_point(average, one.states) for one in judged]
    return mean_score(values, unit.name, "baseline: mean of the training demonstrations at equal shares of duration")


def _nearest_velocities(judged: Judged, known: Sequence[Judged]) -> curves.Curve:
    return baselines.nearest_neighbour_velocities(
        judged.states,
        np.concatenate([one.states for one in known]),
        np.concatenate([one.velocities for one in known]),
    )


def _pooled(
    error: Callable[[curves.Curve, curves.Curve], float],
    pairs: Sequence[tuple[curves.AnyCurve, curves.AnyCurve]],
    unit: str,
    note: str,
) -> Score:
    """An error over the points of all demonstrations; spread and values are those of single demonstrations."""
    predicted, recorded = (np.concatenate(arrays) for arrays in zip(*pairs, strict=True))
    return summary_score(error(predicted, recorded), [error(*pair) for pair in pairs], unit, "pooled", note)


def merged_arrays(evaluations: Iterable[Evaluation]) -> dict[str, np.ndarray]:
    """Arrays of the demonstrations of several evaluations, numbered through."""
    return _numbered(own for evaluation in evaluations for own in _of_demonstrations(evaluation.arrays))


def _arrays(judged: Sequence[Judged]) -> dict[str, np.ndarray]:
    sets = (np.array("train" if one.is_trained else "test") for one in judged)
    parts = ((one.states, one.rollout, one.time_s, own) for one, own in zip(judged, sets, strict=True))
    return _numbered(dict(zip(ARRAYS, own, strict=True)) for own in parts)


def _numbered(parts: Iterable[Mapping[str, np.ndarray]]) -> dict[str, np.ndarray]:
    return {f"{name}_{number}": array for number, own in enumerate(parts) for name, array in own.items()}


def _of_demonstrations(arrays: Mapping[str, np.ndarray]) -> Iterator[dict[str, np.ndarray]]:
    for number in count():
        if f"{ARRAYS[0]}_{number}" not in arrays:
            return
        yield {name: arrays[f"{name}_{number}"] for name in ARRAYS}
