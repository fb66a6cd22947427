"""Distances between two curves, given as arrays of points in time order (thesis Sec. 6.4).

Distances have the unit of the curves [m]; nothing here scales or resamples.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial.distance import cdist

Curve = Float[np.ndarray, "time D"]
OtherCurve = Float[np.ndarray, "other_time D"]
AnyCurve = Float[np.ndarray, "_ D"]  # in collections, where the number of points differs
Curves = Sequence[AnyCurve]


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
    """Monotone alignment of two curves with the smallest sum of distances.

    Attributes:
        sum: Sum of the distances along the path [m].
        pairs: Number of point pairs on the path; of equally good paths, one that prefers steps on both curves.
    """

    sum: float
    pairs: int

    @property
    def mean(self) -> float:
        """Mean distance along the path [m]."""
        return self.sum / self.pairs


def dynamic_time_warping(curve: Curve, other: OtherCurve) -> Alignment:
    """Alignment that goes forward on both curves and has the smallest sum of distances."""
    totals = _cheapest_paths(cdist(curve, other), np.add)
    return Alignment(float(totals[-1, -1]), _count_pairs(totals))


def discrete_frechet(curve: Curve, other: OtherCurve) -> float:
    """Smallest possible largest distance of an alignment that goes forward on both curves [m]."""
    return float(_cheapest_paths(cdist(curve, other), np.maximum)[-1, -1])


def _cheapest_paths(costs: Float[np.ndarray, "n m"], accumulate: np.ufunc) -> Float[np.ndarray, "n+m+1 n+1"]:
    """Cost of the cheapest monotone path to each cell, one anti-diagonal of `costs` at a time.

    Cell (i, j) stands in row i + j + 2, column i + 1. Two rows and a column of padding make its predecessors
    (i-1, j-1), (i-1, j), (i, j-1) plain shifts: two rows up and one left, one up and one left, one up.
    """
    n, m = costs.shape
    rows = np.arange(n)[:, None]
    skewed = np.full((n + m - 1, n), np.inf)
    skewed[rows + np.arange(m), rows] = costs
    totals = np.full((n + m + 1, n + 1), np.inf)
    totals[0, 0] = 0.0  # every path starts in the first cell
    for diagonal, cost in enumerate(skewed):
        before = np.minimum(totals[diagonal, :-1], np.minimum(totals[diagonal + 1, :-1], totals[diagonal + 1, 1:]))
        accumulate(cost, before, out=totals[diagonal + 2, 1:])
    return totals


def _count_pairs(totals: Float[np.ndarray, "rows columns"]) -> int:
    """Follow the cheapest path back from the last cell to the first."""
    row, column = totals.shape[0] - 1, totals.shape[1] - 1
    pairs = 1
    while row > 2:
        predecessors = ((row - 2, column - 1), (row - 1, column - 1), (row - 1, column))
        row, column = min(predecessors, key=lambda cell: float(totals[cell]))
        pairs += 1
    return pairs


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
