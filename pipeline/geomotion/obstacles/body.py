"""What collision checks ask of a body: how far away it surely is."""

from typing import Protocol, runtime_checkable

from geomotion.types import Float, State, Tensor


@runtime_checkable
class Body(Protocol):
    """A body in space; each one's docstring states how far below the true distance its answers may lie.

    Attributes:
        dim: D.
        reference: Point inside it at time zero, shape (D,) [m].
        bounding_radius: Radius of a ball around the reference point that contains it [m].
        inradius: Radius of a ball around the reference point that it contains [m].
        velocity: Its constant velocity, shape (D,) [m/s].
    """

    dim: int
    reference: Tensor
    bounding_radius: float
    inradius: float
    velocity: Tensor

    def signed_distance(self, x: State) -> Float[Tensor, "*batch"]:
        """Distance to the surface [m], negative inside.

        Outside it is never larger than the true distance: the ball of this radius around x is free. Two such balls
        that touch make the straight line between their centres free.
        """
        ...
