"""How well joint positions are reproduced, and how they come back from starts that are off in every joint."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from geomotion.scores.array_field import ArrayField
from geomotion.scores.evaluation import Evaluation
from geomotion.scores.nearby import bound_excess, claimed_coordinates
from geomotion.scores.pushes import Path, settled
from geomotion.scores.reproduction import Judged
from geomotion.scores.score import Score, max_score, mean_score, share_score

NEAR_DEG = 3


@dataclass(frozen=True)
class ReturnProtocol:
    """Starts beside those of demonstrations.

    Attributes:
        count: How many, over all demonstrations in turn.
        offset_rad: By how much every joint is off [rad]: all to one side, all to the other, then to random sides.
        seed: Of the sides.
    """

    count: int
    offset_rad: float
    seed: int

    def offsets(self, joints: int) -> Float[np.ndarray, "start joint"]:
        """Displacements of the joints [rad]."""
        sides = np.random.default_rng(self.seed).choice([-1.0, 1.0], size=(self.count, joints))
        sides[:1], sides[1:2] = 1.0, -1.0
        return np.asarray(self.offset_rad * sides)


def judge_joints(judged: Sequence[Judged], joints: int) -> Evaluation:
    """Scores ``train.joint_…`` and ``heldout.joint_…``: root mean square over joints and equal times.

    Args:
        judged: Trained demonstrations and held-out ones.
        joints: How many of the first coordinates of a state are joint positions [rad].
    """
    scores: dict[str, Score] = {}
    for subset, members in (
        ("train", [one for one in judged if one.is_trained]),
        ("heldout", [one for one in judged if not one.is_trained]),
    ):
        if not members:
            continue
        errors = [(one.rollout - one.states)[:, :joints] for one in members]
        note = f"{joints} joints, at equal times, unscaled"
        scores[f"{subset}.joint_rmse"] = mean_score([_degrees(error) for error in errors], "deg", note)
        worst = [max(_degrees(column) for column in error.T) for error in errors]
        scores[f"{subset}.joint_rmse_worst_joint"] = mean_score(worst, "deg", f"of the joint that is worst; {note}")
    return Evaluation(scores)


@dataclass(frozen=True)
class Returned:
    """What came of starts beside one demonstration, at its times.

    Attributes:
        time_s: After the start [s].
        to_path_rad: Root mean square over joints of the difference to the nearest point of the demonstrated path [rad].
        at_equal_time_rad: The same of the difference to the demonstration at the same time [rad].
        claimed: Distance to the motion from the demonstration's own start, in the metric where contraction is claimed.
        speed_ratio: Highest speed of the joints, of the highest of that motion.
    """

    time_s: Float[np.ndarray, " time"]
    to_path_rad: Float[np.ndarray, "start time"]
    at_equal_time_rad: Float[np.ndarray, "start time"]
    claimed: Float[np.ndarray, "start time"]
    speed_ratio: Float[np.ndarray, " start"]


def judge_returns(
    field: ArrayField, judged: Sequence[Judged], joints: int, protocol: ReturnProtocol, proven_rate: float | None
) -> Evaluation:
    """How long motions from elsewhere take to be back on the demonstrated path, and what is left of the offset.

    A motion is back when it stays near the demonstration, as a curve in joint space, from then on. Distances at equal
    times also count how far it is ahead or behind.

    Args:
        field: Its states begin with joint positions [rad].
        judged: Demonstrations whose starts are displaced, as many of them as the protocol has starts.
        joints: How many joints.
        protocol: The displacements.
        proven_rate: τ > 0 of the certificate [1/s]; None if nothing is proven.
    """
    exact, displaced = field.exact(), judged[: protocol.count]
    parts = [
        follow_displaced(exact, one, protocol.offsets(joints)[number :: len(displaced)])
        for number, one in enumerate(displaced)
    ]
    note = (
        f"{protocol.count} starts off by {protocol.offset_rad:g} rad in each of {joints} joints, {len(displaced)} "
        f"demonstrations, seed {protocol.seed}"
    )
    back_s = np.concatenate([settled(one.to_path_rad, one.time_s, math.radians(NEAR_DEG)) for one in parts])
    name, meaning = (
        f"returns.back_within_{NEAR_DEG}deg",
        f"until the joints stay within {NEAR_DEG} deg (RMS) of the path",
    )
    scores = {
        f"{name}_share": share_score(np.isfinite(back_s), f"before the demonstration ends; {note}"),
        name: mean_score(back_s, "s", f"{meaning}; {note}"),
        f"{name}_worst": max_score(back_s, "s", f"{meaning}; {note}"),
    }
    left = {
        "left_at_end": np.concatenate([one.to_path_rad[:, -1] for one in parts]),
        "left_at_end_equal_time": np.concatenate([one.at_equal_time_rad[:, -1] for one in parts]),
        "left_half_way_equal_time": np.concatenate(
            [one.at_equal_time_rad[:, one.at_equal_time_rad.shape[1] // 2] for one in parts]
        ),
    }
    for name, values_rad in left.items():
        scores[f"returns.{name}"] = mean_score(np.degrees(values_rad), "deg", note)
        scores[f"returns.{name}_worst"] = max_score(np.degrees(values_rad), "deg", note)
    ratio = np.concatenate([one.speed_ratio for one in parts])
    scores["returns.peak_speed"] = mean_score(
        ratio, "1", f"highest joint speed / of the motion from its own start; {note}"
    )
    arrays = {
        "returns_time": parts[0].time_s,
        "returns_to_path": parts[0].to_path_rad,
        "returns_at_equal_time": parts[0].at_equal_time_rad,
    }
    if proven_rate is None:
        return Evaluation(scores, arrays, {"returns.claimed": "the certificate proves no rate of arbitrary states"})
    excesses = [bound_excess(one.claimed, one.time_s, proven_rate, note) for one in parts]
    scores["returns.claimed.bound_excess"] = max(excesses, key=lambda one: one.value)
    return Evaluation(scores, arrays)


def follow_displaced(field: ArrayField, one: Judged, offsets_rad: Float[np.ndarray, "start joint"]) -> Returned:
    """Motions from one demonstration's start and from those beside it."""
    joints = offsets_rad.shape[1]
    starts = np.repeat(one.states[:1], len(offsets_rad) + 1, axis=0)
    starts[1:, :joints] += offsets_rad
    begun = field.begun(np.repeat(one.states[:1], len(starts), axis=0))  # displaced is not begun elsewhere
    rolled = begun.roll(starts, one.time_s)
    demonstrated, moved = one.states[:, :joints], rolled[..., :joints]
    path = Path(demonstrated)
    claimed = claimed_coordinates(field.to_claimed, begun.without_offsets(rolled, one.time_s))
    single = field.begun(one.states[:1])
    speeds = np.array([_top_speed(single, states, one.time_s, joints) for states in rolled])
    return Returned(
        one.time_s,
        np.stack([path.distances(states) for states in moved[1:]]) / math.sqrt(joints),
        np.sqrt(np.square(moved[1:] - demonstrated).mean(axis=-1)),
        np.linalg.norm(claimed[1:] - claimed[:1], axis=-1),
        speeds[1:] / speeds[0],
    )


def _top_speed(
    field: ArrayField, states: Float[np.ndarray, "time D"], time_s: Float[np.ndarray, " time"], joints: int
) -> float:
    return float(np.linalg.norm(field.velocity(states, time_s)[:, :joints], axis=1).max())


def _degrees(difference_rad: Float[np.ndarray, "*any"]) -> float:
    return math.degrees(math.sqrt(np.square(difference_rad).mean()))
