"""Coordinates of an open ball that go on for ever: ψ maps the ball to all of space and back.

Log and Exp are inverse to each other inside the first cover, a ball. A chart that ends in such coordinates cannot leave
it, whatever its parameters.
"""

import math
from typing import Protocol

import torch

from geomotion.types import Float, Tensor

Vector = Float[Tensor, "*batch 3"]
TINY = 1e-12  # of a vector's length, below which its direction is of no consequence


class Cover(Protocol):
    """A bijection between space and the open ball, the identity to first order where it is smooth at the centre."""

    def to_ball(self, flat: Vector) -> Vector:
        """Into the ball."""
        ...

    def to_flat(self, inside: Vector) -> Vector:
        """Out of the ball, for points inside it."""
        ...

    def push(self, flat: Vector, tangent: Vector) -> Vector:
        """How fast the point in the ball moves."""
        ...


class RadialCover:
    """u ↦ r tanh(‖u‖/r) u/‖u‖: a diffeomorphism.

    Args:
        radius: r, of the ball.
    """

    def __init__(self, radius: float) -> None:
        self.radius = radius

    def to_ball(self, flat: Vector) -> Vector:
        return flat * self._shrinking(flat)[0]

    def to_flat(self, inside: Vector) -> Vector:
        share = inside.norm(dim=-1, keepdim=True) / self.radius
        ratio = torch.where(share < 1e-4, 1 + share.square() / 3, _atanh(share) / torch.where(share == 0, 1, share))
        return inside * ratio

    def push(self, flat: Vector, tangent: Vector) -> Vector:
        ratio, slope = self._shrinking(flat)
        direction = flat / flat.norm(dim=-1, keepdim=True).clamp_min(TINY)
        along = direction * (direction * tangent).sum(-1, keepdim=True)
        pushed: Tensor = ratio * (tangent - along) + slope * along
        return pushed

    def _shrinking(self, flat: Vector) -> tuple[Tensor, Tensor]:
        """tanh(s)/s and its radial counterpart 1 - tanh², at s = ‖u‖/r."""
        share = flat.norm(dim=-1, keepdim=True) / self.radius
        squashed = share.tanh()
        ratio = torch.where(share < 1e-4, 1 - share.square() / 3, squashed / torch.where(share == 0, 1, share))
        return ratio, 1 - squashed.square()


class CubeCover:
    r"""The thesis' cover r b(tanh(u/r)), continuous and invertible, but with kinks where coordinates tie and at 0.

    .. math:: b(x) = \frac{\|x\|_\infty}{\|x\|_2}\, x

    Args:
        radius: r, of the ball.

    Source:
        Thesis Eq. (6.4).
    """

    def __init__(self, radius: float) -> None:
        self.radius = radius

    def to_ball(self, flat: Vector) -> Vector:
        box = (flat / self.radius).tanh()
        return self.radius * box * _ratio(box)

    def to_flat(self, inside: Vector) -> Vector:
        ball = inside / self.radius
        return self.radius * _atanh(ball / _ratio(ball))

    def push(self, flat: Vector, tangent: Vector) -> Vector:
        box = (flat / self.radius).tanh()
        tangent = tangent * (1 - box.square())
        length, ratio = box.norm(dim=-1, keepdim=True).clamp_min(TINY), _ratio(box)
        largest = box.abs().argmax(-1, keepdim=True)
        rising = (box.gather(-1, largest).sign() * tangent.gather(-1, largest)) / length
        falling = ratio * (box * tangent).sum(-1, keepdim=True) / length.square()
        pushed: Tensor = ratio * tangent + (rising - falling) * box
        return pushed


def _atanh(x: Tensor) -> Tensor:
    """Runtimes of exported policies know it in single precision alone, where logarithms would not do."""
    if x.dtype == torch.float32:
        return x.atanh()
    return ((1 + x).log() - (1 - x).log()) / 2


def _ratio(x: Vector) -> Float[Tensor, "*batch 1"]:
    """‖x‖∞ / ‖x‖₂; that along an axis at the centre."""
    length = x.norm(dim=-1, keepdim=True)
    return torch.where(length < TINY, 1, x.abs().amax(-1, keepdim=True) / length.clamp_min(TINY))


FIRST_COVER = {"SO3": math.pi, "S3": 2 * math.pi}  # radius of the ball of rotation vectors that are told apart [rad]
