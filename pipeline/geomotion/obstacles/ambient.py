r"""Obstacles as a soft constraint: the ambient metric grows near them (thesis Sec. 3.5.3).

.. math:: M_p(x) = \Big(1 + \sum_o \zeta_o \exp\frac{-(d_o(x) + r_o)_+^2}{2 r_o^2}\Big) I

with the signed distance d to the surface of an obstacle and the radius r of a ball that it contains. For a sphere d + r
is the distance to its centre, and with one of them this is Eq. (3.15); the orientation part (3.16) stays the identity.
Gains of several obstacles add: each one only adds to the metric, a positive semi-definite difference, and where two
overlap, the cost is that of both, where a product would square it.
"""

from collections.abc import Sequence
from math import log, sqrt

import numpy as np

from geomotion.errors import InvalidSetting
from geomotion.types import Float

Distances = Float[np.ndarray, "*batch"]


def ambient_factor(distance_to_surface_m: Distances, radius_m: float, gain: float) -> Distances:
    """What one obstacle multiplies the metric of positions with, between 1 and 1 + gain.

    Args:
        distance_to_surface_m: Signed distances, negative inside.
        radius_m: r, the body's inradius; a grasped object's radius is added to it and taken off the distance.
        gain: ζ.

    Raises:
        InvalidSetting: If the radius is not positive, or the gain negative.

    Source:
        Thesis Eq. (3.15), with ‖x - o‖ = max(d + r, 0).
    """
    if not (radius_m > 0 and gain >= 0):
        raise InvalidSetting("radius_m, gain", (radius_m, gain), "a radius above 0 and a gain of 0 or more")
    scaled = (distance_to_surface_m / radius_m + 1).clip(min=0)
    return np.asarray(1 + gain * np.exp(-(scaled**2) / 2))


def combine_factors(factors: Sequence[Distances]) -> Distances:
    """The factor of several obstacles: gains add, none leaves the metric alone."""
    return np.asarray(1 + np.sum([factor - 1 for factor in factors], axis=0))


def reach_m(radius_m: float, tolerance: float = 1e-3) -> float:
    """Distance from the surface beyond which the factor is below 1 + tolerance times gain [m].

    Raises:
        InvalidSetting: If the radius is not positive, or the tolerance not between 0 and 1.
    """
    if not (radius_m > 0 and 0 < tolerance < 1):
        raise InvalidSetting("radius_m, tolerance", (radius_m, tolerance), "a radius above 0 and a tolerance in (0, 1)")
    return radius_m * (sqrt(-2 * log(tolerance)) - 1)
