"""What a score has to be compared with: how far people's repetitions of one skill are from each other."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from geomotion.scores.curves import Curve, Curves, OtherCurve, dtwd_per_point


def distances_between(curves: Curves) -> Float[np.ndarray, " pair"]:
    """DTWD per point of every pair of different curves [m]."""
    return np.array([dtwd_per_point(one, other) for one, other in combinations(curves, 2)])


def distances_to_nearest(curves: Curves, candidates: Curves) -> Float[np.ndarray, " curve"]:
    """DTWD per point of each curve to the nearest candidate [m]; a curve is no candidate for itself."""
    return np.array(
        [
            min(dtwd_per_point(curve, candidate) for candidate in candidates if candidate is not curve)
            for curve in curves
        ]
    )


def averaged_curve(curves: Curves, times_s: Sequence[Float[np.ndarray, " _"]]) -> OtherCurve:
    """Mean of the curves at equal shares of their durations, with as many points as the longest of them."""
    shares = np.linspace(0.0, 1.0, max(len(curve) for curve in curves))
    resampled = []
    for curve, time_s in zip(curves, times_s, strict=True):
        share = (time_s - time_s[0]) / (time_s[-1] - time_s[0])
        resampled.append(np.stack([np.interp(shares, share, axis) for axis in curve.T], axis=1))
    return np.asarray(np.mean(resampled, axis=0))


def nearest_neighbour_velocities(states: Curve, known_states: OtherCurve, known_velocities: OtherCurve) -> Curve:
    """Velocity of the nearest known state, for each state: the simplest model without training."""
    _, nearest = cKDTree(known_states).query(states)
    return np.asarray(known_velocities[nearest])
