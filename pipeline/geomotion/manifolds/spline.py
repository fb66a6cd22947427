"""Cubic splines through graph paths."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float

DEGREE = 3
CURVATURE_PENALTY = 1e-3


@dataclass(frozen=True)
class LatentSpline:
    """A cubic spline over [0, 1] in latent space, clamped at both ends.

    Attributes:
        knots: Knot vector, ends repeated.
        coefficients: Control points, shape (knot, d); the first and last are the ends of the curve.
    """

    knots: Float[np.ndarray, " knots"]
    coefficients: Float[np.ndarray, "knot d"]

    def points(self, count: int) -> Float[np.ndarray, "point d"]:
        """Points at evenly spaced parameters."""
        return np.asarray(_even_basis(tuple(self.knots.tolist()), count) @ self.coefficients)

    def basis(self, count: int) -> Float[np.ndarray, "point knot"]:
        """Values of the basis functions at evenly spaced parameters."""
        return _even_basis(tuple(self.knots.tolist()), count).copy()


def fit_spline(points: Float[np.ndarray, "point d"], control_points: int) -> LatentSpline:
    """Least-squares spline through points, exact at both ends.

    What is fitted is the difference to the straight line between the ends, with a small penalty on bending: paths of
    few points then stay near their chord instead of being drawn to the origin.

    Args:
        points: At least two.
        control_points: Of the spline; at least four.

    Source: Thesis Sec. 3.5.1, 3.5.4.
    """
    knots, greville, bending = _clamped(control_points)
    line = points[0] + greville[:, None] * (points[-1] - points[0])
    basis = _basis(knots, _chord_parameters(points))
    normal = (basis.T @ basis + bending)[1:-1, 1:-1]
    inner = np.linalg.solve(normal, basis.T[1:-1] @ (points - basis @ line))
    coefficients = line.copy()
    coefficients[1:-1] += inner
    return LatentSpline(knots, coefficients)


def polyline(points: Float[np.ndarray, "point d"], count: int) -> Float[np.ndarray, "sample d"]:
    """Points evenly spaced along the straight pieces between `points`."""
    share = _chord_parameters(points)
    return np.stack([np.interp(np.linspace(0, 1, count), share, axis) for axis in points.T], axis=1)


def even_basis(control_points: int, count: int) -> Float[np.ndarray, "point knot"]:
    """Values of the basis functions of a spline with even knots, clamped at both ends, at evenly spaced parameters."""
    return _even_basis(tuple(_clamped(control_points)[0].tolist()), count).copy()


@lru_cache
def _clamped(
    control_points: int,
) -> tuple[Float[np.ndarray, " knots"], Float[np.ndarray, " knot"], Float[np.ndarray, "knot knot"]]:
    """Even knots, where each basis function has its mean (Greville), and the penalty on bending."""
    knots = np.concatenate([[0.0] * DEGREE, np.linspace(0, 1, control_points - DEGREE + 1), [1.0] * DEGREE])
    greville = np.array([knots[k + 1 : k + 1 + DEGREE].mean() for k in range(control_points)])
    bends = np.diff(np.eye(control_points), n=2, axis=0)
    return knots, greville, CURVATURE_PENALTY * bends.T @ bends


@lru_cache
def _even_basis(knots: tuple[float, ...], count: int) -> Float[np.ndarray, "point knot"]:
    return _basis(np.array(knots), np.linspace(0, 1, count))


def _basis(knots: Float[np.ndarray, " knots"], share: Float[np.ndarray, " point"]) -> Float[np.ndarray, "point knot"]:
    """Values of the basis functions by the recursion of Cox and de Boor; for few points faster than scipy's."""
    last = len(knots) - DEGREE - 2
    span = np.clip(np.searchsorted(knots, share, side="right") - 1, DEGREE, last)[:, None]
    around = knots[span + np.arange(1 - DEGREE, DEGREE + 1)]
    values = np.ones((len(share), 1))
    for degree in range(1, DEGREE + 1):
        low, high = around[:, DEGREE - degree : DEGREE], around[:, DEGREE : DEGREE + degree]
        rising = (share[:, None] - low) / (high - low)
        above = np.zeros((len(share), degree + 1))
        above[:, 1:] = values * rising
        above[:, :-1] += values * (1 - rising)
        values = above
    basis = np.zeros((len(share), last + 1))
    np.put_along_axis(basis, span + np.arange(-DEGREE, 1), values, axis=1)
    return basis


def _chord_parameters(points: Float[np.ndarray, "point d"]) -> Float[np.ndarray, " point"]:
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    return np.asarray(travelled / travelled[-1]) if travelled[-1] > 0 else np.linspace(0, 1, len(points))
