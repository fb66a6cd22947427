"""How the distance between rollouts from nearby starts evolves (thesis Fig. 6.6)."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from geomotion.scores.evaluation import Evaluation, Roll
from geomotion.scores.score import Score, share_score

ToClaimed = Callable[[Float[np.ndarray, "point D"]], Float[np.ndarray, "point D"]]
Distances = Float[np.ndarray, "pair time"]


def nearby_starts(
    start: Float[np.ndarray, " D"], count: int, deviation: float, seed: int
) -> Float[np.ndarray, "{count} D"]:
    """Starts drawn from N(start, deviation² I) [m]."""
    return np.random.default_rng(seed).normal(start, deviation, size=(count, len(start)))


def pairwise_distances(trajectories: Float[np.ndarray, "start time D"]) -> Distances:
    """Distance of every pair of trajectories at equal times."""
    first, second = np.triu_indices(len(trajectories), k=1)
    return np.asarray(np.linalg.norm(trajectories[first] - trajectories[second], axis=-1))


def judge_nearby(
    roll: Roll,
    to_claimed: ToClaimed,
    starts: Float[np.ndarray, "start D"],
    times_s: Float[np.ndarray, " time"],
    proven_rate: float | None,
) -> Evaluation:
    """Distances in the Euclidean metric and in the one in which contraction is claimed.

    Args:
        roll: The judged field's trajectories, precise: what a solver gets wrong counts against the bound.
        to_claimed: ψ: in its coordinates the claimed metric is Euclidean.
        starts: Nearby starts [m].
        times_s: Times after the start [s].
        proven_rate: τ > 0 of the certificate [1/s]; None if nothing is proven.

    Source:
        Thesis Fig. 6.6; Definition 2.1 for the bound e^{-τt}.
    """
    if len(starts) < 2:
        return Evaluation(omitted={"nearby": "distances need two rollouts; set evaluation.nearby_starts above 1"})
    euclidean, claimed = nearby_distances(roll, to_claimed, starts, times_s)
    note = f"{len(starts)} rollouts, {len(euclidean)} pairs, {len(times_s)} times over {times_s[-1]:.3g} s"
    scores = distance_scores(euclidean, "nearby.euclidean", note) | distance_scores(claimed, "nearby.claimed", note)
    arrays = {
        "nearby_starts": starts,
        "nearby_time": times_s,
        "nearby_euclidean": euclidean.mean(axis=0),
        "nearby_claimed": claimed.mean(axis=0),
        "nearby_bound": np.empty(0),
    }
    if proven_rate is None:
        return Evaluation(scores, arrays, {"nearby.claimed.bound_excess": "the certificate proves no rate"})
    scores["nearby.claimed.bound_excess"] = bound_excess(claimed, times_s, proven_rate, note)
    arrays["nearby_bound"] = np.exp(-proven_rate * times_s) * claimed[:, 0].mean()
    return Evaluation(scores, arrays)


def distance_scores(distances: Distances, prefix: str, note: str) -> dict[str, Score]:
    """How the mean distance over pairs changes with time."""
    mean = distances.mean(axis=0)
    return {
        f"{prefix}.max_expansion": Score(
            float((mean / mean[0]).max()), "1", len(distances), statistic="max", note=f"mean distance / initial; {note}"
        ),
        f"{prefix}.growing_share": share_score(np.diff(mean) > 0, f"steps in which the mean distance grows; {note}"),
        f"{prefix}.final_ratio": Score(
            float(mean[-1] / mean[0]), "1", len(distances), statistic="final / initial mean", note=note
        ),
    }


def nearby_distances(
    roll: Roll, to_claimed: ToClaimed, starts: Float[np.ndarray, "start D"], times_s: Float[np.ndarray, " time"]
) -> tuple[Distances, Distances]:
    """Distances between all rollouts at all times, Euclidean ones [m] and those of the claimed metric."""
    trajectories = roll(starts, times_s)
    return pairwise_distances(trajectories), pairwise_distances(claimed_coordinates(to_claimed, trajectories))


def claimed_coordinates(
    to_claimed: ToClaimed, trajectories: Float[np.ndarray, "start time D"]
) -> Float[np.ndarray, "start time d"]:
    """Trajectories in the coordinates where the claimed metric is Euclidean."""
    return to_claimed(trajectories.reshape(-1, trajectories.shape[-1])).reshape(*trajectories.shape[:-1], -1)


def bound_excess(distances: Distances, times_s: Float[np.ndarray, " time"], rate: float, note: str) -> Score:
    """Largest (d(t) - e^{-τt} d(0)) / d(0) over pairs and t > 0.

    At most 0 where the bound holds. Dividing by d(0) instead of the bound keeps round-off small where both vanish.
    """
    initial = distances[:, :1]
    excess = (distances / initial - np.exp(-rate * (times_s - times_s[0])))[:, 1:]
    statement = f"d(t) <= exp(-{rate:.4g} t) d(0) holds up to this share of d(0); {note}"
    return Score(float(excess.max()), "1", int(excess.size), statistic="max", note=statement)
