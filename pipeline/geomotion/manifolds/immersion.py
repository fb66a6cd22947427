"""What a decoder has to offer to span a manifold."""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

from geomotion.types import Float, Tensor

Latent = Float[Tensor, "*batch d"]
Conformal = Callable[[Tensor], Tensor]
"""Latent points → factor f > 0 by which lengths are stretched there."""


@runtime_checkable
class Immersion(Protocol):
    """A map of latent points into a Euclidean space, in blocks of coordinates.

    Its pulled-back metric is the expected metric of a stochastic decoder if the coordinates are the decoder's means and
    standard deviations, Eq. (2.10), (2.11). Positions stand apart because obstacles act on them alone, Eq. (3.16), on
    each by a factor of its own, Eq. (4.4): B of them are the end effector alone, or points of the whole body.

    Attributes:
        latent_dim: d.
    """

    latent_dim: int

    def blocks(self, z: Latent) -> tuple[Float[Tensor, "*batch B P"], Float[Tensor, "*batch Q"]]:
        """Coordinates that belong to each position, and all others."""
        ...

    def positions(self, z: Latent) -> Float[Tensor, "*batch B Dx"]:
        """Mean positions in space [m], where obstacles are."""
        ...
