"""The obstacle that a field avoids in place of a polygon or mesh."""

from geomotion.obstacles.boundary import Boundary
from geomotion.obstacles.polytope import Polytope
from geomotion.obstacles.star import StarShape
from geomotion.types import Tensor


def enclose(
    boundary: Boundary, rounding: float | None = None, convex_hull: bool = False, velocity: Tensor | None = None
) -> Polytope | StarShape:
    """A body that contains the one within a boundary, and whose Γ is smooth.

    Args:
        boundary: The surface.
        rounding: By how much the body grows [m]; a tenth of its inradius if omitted and it is convex.
        convex_hull: Whether the convex hull is avoided in any case.
        velocity: Shape (D,) [m/s].

    Raises:
        InvalidSetting: If the body is neither convex nor star-shaped.
    """
    if convex_hull or boundary.is_convex:
        return Polytope(boundary.vertices, rounding, velocity)
    return StarShape(boundary, velocity, rounding or 0.0)
