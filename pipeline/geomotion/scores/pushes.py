"""How a motion recovers from pushes: the field alone, started anew beside its undisturbed path."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from geomotion.scores.array_field import ArrayField
from geomotion.scores.evaluation import Evaluation
from geomotion.scores.nearby import bound_excess, claimed_coordinates
from geomotion.scores.score import Score, max_score, mean_score, share_score

TIMES_PER_DURATION = 400
FOLLOWED = 1.0  # durations after the push
UNDISTURBED = 3.0  # durations of the motions without a push, which end near the goal
REFINED = 10  # points of a path between two times, so that it counts as a curve
RETURNS = ((25, 0.06), (10, 0.25))  # distance [mm], and the share of the duration in which it is to be reached
LARGEST_SPEED_RATIO = 1.5
RECOVERED = 5.0  # times closer than right after the push

Distances = Float[np.ndarray, "push time"]


@dataclass(frozen=True)
class PushProtocol:
    """Which pushes a motion is judged under.

    Attributes:
        count: How many, over all starts in turn.
        size_m: By how far each displaces the position [m].
        at: When, as a share of the duration.
        duration_s: Of the motion [s].
        seed: Of their directions.
    """

    count: int
    size_m: float
    at: float
    duration_s: float
    seed: int

    def offsets(self, dim: int) -> Float[np.ndarray, "push D"]:
        """Displacements of the state, along random directions of its first three coordinates [m]."""
        directions = np.random.default_rng(self.seed).normal(size=(self.count, 3))
        offsets = np.zeros((self.count, dim))
        offsets[:, :3] = self.size_m * directions / np.linalg.norm(directions, axis=1, keepdims=True)
        return offsets


@dataclass(frozen=True)
class Pushed:
    """What came of all pushes, at times after them.

    Attributes:
        time_s: From 0 [s].
        to_path_m: Distance to the nearest point of the undisturbed path, of positions [m].
        at_equal_time_m: Distance to the undisturbed position of the same time [m].
        claimed: Distance to the undisturbed state of the same time, in the metric where contraction is claimed.
        speed_ratio: Highest speed of the position after each push, of the highest of the undisturbed motion.
    """

    time_s: Float[np.ndarray, " time"]
    to_path_m: Distances
    at_equal_time_m: Distances
    claimed: Distances
    speed_ratio: Float[np.ndarray, " push"]


def judge_pushes(
    field: ArrayField, starts: Float[np.ndarray, "start D"], protocol: PushProtocol, proven_rate: float | None
) -> Evaluation:
    """Times until pushed motions are back beside their undisturbed paths, what is left, and how fast they go.

    A motion is back when its position stays near its undisturbed path, as a curve, from then on. Distances at equal
    times, which also count what a push cost or gained in time, are given for the end.

    Args:
        field: Its states begin with a position in space [m].
        starts: Where undisturbed motions begin.
        protocol: The pushes.
        proven_rate: τ > 0 of the certificate [1/s]; None if nothing is proven.
    """
    pushed = follow_pushed(field, starts, protocol)
    note = (
        f"{protocol.count} pushes of {1000 * protocol.size_m:.3g} mm in random directions at {protocol.at:.0%} of the "
        f"motion, {len(starts)} starts, seed {protocol.seed}; duration {protocol.duration_s:.3g} s"
    )
    scores: dict[str, Score] = {}
    shares = pushed.time_s / protocol.duration_s
    for limit_mm, within in RETURNS:
        scores |= _return_scores(pushed.to_path_m, shares, limit_mm, within, note)
    end = int(np.searchsorted(shares, 1 - protocol.at))
    for name, distances in (("left_at_end", pushed.to_path_m), ("left_at_end_equal_time", pushed.at_equal_time_m)):
        scores[f"pushes.{name}"] = mean_score(1000 * distances[:, end], "mm", note)
        scores[f"pushes.{name}_worst"] = max_score(1000 * distances[:, end], "mm", note)
    ratio, meaning = pushed.speed_ratio, "highest speed of the position after the push / of the undisturbed motion"
    scores["pushes.peak_speed"] = mean_score(ratio, "1", f"{meaning}; {note}")
    scores["pushes.peak_speed_worst"] = max_score(ratio, "1", f"{meaning}; {note}")
    is_calm = ratio <= LARGEST_SPEED_RATIO
    scores["pushes.peak_speed_share"] = share_score(is_calm, f"at most {LARGEST_SPEED_RATIO}; {meaning}; {note}")
    arrays = {"pushes_time": shares, "pushes_to_path": pushed.to_path_m}
    if proven_rate is None:
        return Evaluation(scores, arrays, {"pushes.claimed": "the certificate proves no rate of pushed states"})
    scores["pushes.claimed.bound_excess"] = bound_excess(pushed.claimed, pushed.time_s, proven_rate, note)
    scores["pushes.claimed.recovery_ratio"] = _recovery_ratio(pushed, proven_rate, note)
    return Evaluation(scores, arrays)


def follow_pushed(field: ArrayField, starts: Float[np.ndarray, "start D"], protocol: PushProtocol) -> Pushed:
    """Undisturbed motions from each start, and pushed ones from what these are displaced to."""
    step_s = protocol.duration_s / TIMES_PER_DURATION
    push = round(protocol.at * TIMES_PER_DURATION)
    after = slice(push, push + round(FOLLOWED * TIMES_PER_DURATION) + 1)
    times_s = step_s * np.arange(round(UNDISTURBED * TIMES_PER_DURATION) + 1)
    undisturbed = field.roll(starts, times_s)
    nominal = _speeds(field, starts, undisturbed, times_s).max(axis=1)
    start = np.arange(protocol.count) % len(starts)
    later = field.begun(starts[start]).later(float(times_s[push]))
    after_s = times_s[after] - times_s[push]
    pushed = later.roll(undisturbed[start, push] + protocol.offsets(starts.shape[1]), after_s)
    alongside = undisturbed[start, after]
    claimed, beside = (
        claimed_coordinates(field.to_claimed, later.without_offsets(states, after_s)) for states in (pushed, alongside)
    )
    speeds = _speeds(field, starts[start], pushed, times_s[after])
    paths = [Path(path[:, :3]) for path in undisturbed]
    to_path = [paths[which].distances(states[:, :3]) for which, states in zip(start, pushed, strict=True)]
    return Pushed(
        after_s,
        np.array(to_path),
        np.linalg.norm(pushed[..., :3] - alongside[..., :3], axis=-1),
        np.linalg.norm(claimed - beside, axis=-1),
        speeds.max(axis=1) / nominal[start],
    )


def settled(distances: Distances, shares: Float[np.ndarray, " time"], limit: float) -> Float[np.ndarray, " push"]:
    """From when on each distance stays within a limit, infinite where it ends beyond it."""
    is_beyond = ~(distances <= limit)
    first = len(shares) - np.where(is_beyond.any(axis=1), is_beyond[:, ::-1].argmax(axis=1), len(shares))
    return np.asarray(np.append(shares, np.inf)[first])


def _return_scores(
    to_path_m: Distances, shares: Float[np.ndarray, " time"], limit_mm: int, within: float, note: str
) -> dict[str, Score]:
    times = settled(to_path_m, shares, limit_mm / 1000)
    name = f"pushes.back_within_{limit_mm}mm"
    meaning = f"of the duration, until the position stays within {limit_mm} mm of the undisturbed path; {note}"
    return {
        f"{name}_share": share_score(times <= within + 1e-9, f"within {within:.0%} of the duration; {note}"),
        name: mean_score(100 * times, "%", meaning),
        f"{name}_worst": max_score(100 * times, "%", meaning),
    }


def _recovery_ratio(pushed: Pushed, rate: float, note: str) -> Score:
    relative = pushed.claimed / pushed.claimed[:, :1]
    times_s = settled(relative, pushed.time_s, 1 / RECOVERED)
    promised_s = math.log(RECOVERED) / rate
    meaning = f"time until the claimed distance is {RECOVERED:g} times smaller / what the rate promises; {note}"
    return max_score(times_s / promised_s, "1", meaning)


def _speeds(
    field: ArrayField,
    starts: Float[np.ndarray, "start D"],
    states: Float[np.ndarray, "start time D"],
    times_s: Float[np.ndarray, " time"],
) -> Float[np.ndarray, "start time"]:
    """Speeds of positions at times since motions began at these starts [m/s]."""
    elapsed_s = np.tile(times_s, len(states))
    begun = field.begun(np.repeat(starts, len(times_s), axis=0))
    velocities = begun.velocity(states.reshape(-1, states.shape[-1]), elapsed_s)
    return np.asarray(np.linalg.norm(velocities[:, :3], axis=1).reshape(states.shape[:2]))


class Path:
    """A curve in space or in joint space, ready for queries.

    Args:
        points: In the order in which they are passed, with straight lines between them [m or rad].
    """

    def __init__(self, points: Float[np.ndarray, "point D"]) -> None:
        numbers = np.arange(len(points))
        between = np.linspace(0, numbers[-1], REFINED * numbers[-1] + 1)
        self._tree = cKDTree(np.stack([np.interp(between, numbers, one) for one in points.T], axis=-1))

    def distances(self, positions: Float[np.ndarray, "time D"]) -> Float[np.ndarray, " time"]:
        """From positions to the nearest point of the path; infinite where a position is not finite."""
        is_finite = np.isfinite(positions).all(axis=1)
        distances = np.full(len(positions), np.inf)
        distances[is_finite] = self._tree.query(positions[is_finite])[0]
        return distances
