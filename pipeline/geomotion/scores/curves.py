"""Distances between two curves, given as arrays of points in time order (thesis Sec. 6.4).

Distances have the unit of the curves [m]; nothing here scales or resamples.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial.distance import cdist

Curve = Float[np.ndarray, "time D"]
OtherCurve = Float[np.ndarray, "other_time D"]


def dtwd_sum(curve: Curve, other: OtherCurve) -> float:
    """Symmetric sum of nearest-point distances, which the thesis names dynamic time warping distance.

    There is no monotone alignment in it: the order of the points plays no part, so a curve and its reversal
    are at distance zero (see :func:`align` for real time warping). It grows with the number of points.

    Source:
        Thesis Sec. 6.4, definition of DTWD.
    """
    to_other, to_curve = _nearest_distances(curve, other)
    return float(to_other.sum() + to_curve.sum())


def dtwd_per_point(curve: Curve, other: OtherCurve) -> float:
    """As :func:`dtwd_sum`, each of the two sums divided by its number of points [m].

    Half of it is the mean distance to the nearest point of the other curve.
    """
    to_other, to_curve = _nearest_distances(curve, other)
    return float(to_other.mean() + to_curve.mean())


def _nearest_distances(
    curve: Curve, other: OtherCurve
) -> tuple[Float[np.ndarray, " time"], Float[np.ndarray, " other_time"]]:
    distances = cdist(curve, other)
    return distances.min(axis=1), distances.min(axis=0)


@dataclass(frozen=True)
class Alignment:
    """Optimal monotone alignment of two curves.

    Attributes:
        cost: Sum (time warping) or maximum (Fréchet) of the distances along the path [m].
        pairs: Number of point pairs on the path.
    """

    cost: float
    pairs: int

    @property
    def mean(self) -> float:
        """Cost per pair of the path [m]."""
        return self.cost / self.pairs


def dynamic_time_warping(curve: Curve, other: OtherCurve) -> Alignment:
    """Alignment that goes forward on both curves and has the smallest sum of distances."""
    return _align(cdist(curve, other), np.add)


def discrete_frechet(curve: Curve, other: OtherCurve) -> float:
    """Smallest possible largest distance of an alignment that goes forward on both curves [m]."""
    return _align(cdist(curve, other), np.maximum).cost


def _align(costs: Float[np.ndarray, "n m"], accumulate: np.ufunc) -> Alignment:
    """Dynamic programme over the anti-diagonals of `costs`, each of which is one vector operation.

    Row k of the skewed array holds the cells (i, k - i) in column i. The programme's values carry one cell of
    padding in front, so that the three predecessors of column i are plain shifts.
    """
    n, m = costs.shape
    rows = np.arange(n)[:, None]
    skewed = np.full((n + m - 1, n), np.inf)
    skewed[rows + np.arange(m), rows] = costs

    outside = np.full(n + 1, np.inf)
    before_previous, previous = outside.copy(), outside.copy()
    before_previous[0] = 0.0  # the path starts in the first cell
    pairs_before_previous, pairs_previous = np.zeros(n + 1, dtype=int), np.zeros(n + 1, dtype=int)
    columns = np.arange(n)
    for diagonal in skewed:
        # The diagonal move comes first: among equally good paths it is the shortest.
        predecessors = np.stack([before_previous[:-1], previous[:-1], previous[1:]])
        pairs = np.stack([pairs_before_previous[:-1], pairs_previous[:-1], pairs_previous[1:]])
        best = predecessors.argmin(axis=0)
        before_previous, pairs_before_previous = previous, pairs_previous
        previous = np.concatenate([[np.inf], accumulate(diagonal, predecessors[best, columns])])
        pairs_previous = np.concatenate([[0], pairs[best, columns] + 1])
    return Alignment(float(previous[n]), int(pairs_previous[n]))


def end_point_error(curve: Curve, other: OtherCurve) -> float:
    """Distance between the last points [m]."""
    return float(np.linalg.norm(curve[-1] - other[-1]))


def start_error(curve: Curve, other: OtherCurve) -> float:
    """Distance between the first points [m]: the jump of a model that projects its start."""
    return float(np.linalg.norm(curve[0] - other[0]))


def root_mean_square_error(curve: Curve, other: Curve) -> float:
    """Root of the mean squared distance between equal rows: states at equal times [m], or velocities [m/s]."""
    return float(np.sqrt(((curve - other) ** 2).sum(axis=1).mean()))


def relative_error(predicted: Curve, recorded: Curve) -> float:
    """sqrt(mean|v - v̂|² / mean|v|²) of predicted velocities v̂; 1 is what the zero field reaches."""
    return root_mean_square_error(predicted, recorded) / float(np.sqrt((recorded**2).sum(axis=1).mean()))
