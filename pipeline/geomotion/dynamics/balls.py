"""Numbers known up to an error: midpoint-radius interval arithmetic on tensors in double precision.

Every result contains the exact result for all numbers that its operands contain. Rounding counts as error: each
operation widens its radius by a bound on its own rounding, the usual γ_n = n u / (1 - n u) for n terms in any order.
"""

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

ROUND_OFF = 2.0**-53  # u: relative error of one operation
SLACK = 1 + 64 * ROUND_OFF  # covers the few operations by which a radius itself is computed
UNDERFLOW = 1e-300


@dataclass(frozen=True)
class Ball:
    """All numbers within `radius` of `mid`, entry by entry.

    Attributes:
        mid: Double precision, any shape.
        radius: Not negative, the same shape.
    """

    mid: Tensor
    radius: Tensor

    @classmethod
    def exact(cls, mid: Tensor) -> "Ball":
        """A number without error."""
        return cls(mid, torch.zeros_like(mid))

    @classmethod
    def between(cls, lower: Tensor, upper: Tensor) -> "Ball":
        """The numbers from `lower` to `upper`."""
        mid = (lower + upper) / 2
        return cls(mid, _widened(torch.maximum(upper - mid, mid - lower), ROUND_OFF * (lower.abs() + upper.abs())))

    @property
    def magnitude(self) -> Tensor:
        """Bound on the absolute value."""
        return (self.mid.abs() + self.radius) * SLACK

    @property
    def mT(self) -> "Ball":  # noqa: N802 - the name that tensors have for it
        """Transposed in the last two axes."""
        return Ball(self.mid.mT, self.radius.mT)

    def __getitem__(self, index: Any) -> "Ball":
        return Ball(self.mid[index], self.radius[index])

    def transpose(self, first: int, second: int) -> "Ball":
        """With two axes exchanged."""
        return Ball(self.mid.transpose(first, second), self.radius.transpose(first, second))

    def unflatten(self, dim: int, sizes: tuple[int, ...]) -> "Ball":
        """With one axis made several."""
        mid, radius = (part.unflatten(dim, sizes) for part in (self.mid, self.radius))  # type: ignore[no-untyped-call]
        return Ball(mid, radius)

    def diagonal(self) -> "Ball":
        """Diagonal matrices."""
        return Ball(self.mid.diag_embed(), self.radius.diag_embed())

    def __neg__(self) -> "Ball":
        return Ball(-self.mid, self.radius)

    def __add__(self, other: "Ball") -> "Ball":
        mid = self.mid + other.mid
        return Ball(mid, _widened(self.radius + other.radius, ROUND_OFF * mid.abs()))

    def __sub__(self, other: "Ball") -> "Ball":
        return self + -other

    def __mul__(self, other: "Ball") -> "Ball":
        mid = self.mid * other.mid
        radius = self.mid.abs() * other.radius + self.radius * (other.mid.abs() + other.radius)
        return Ball(mid, _widened(radius, ROUND_OFF * mid.abs()))

    def __matmul__(self, other: "Ball") -> "Ball":
        error = _summation_error(other.mid.shape[-2])
        mine, theirs = self.mid.abs(), other.mid.abs()
        radius = mine @ (other.radius + error * theirs) + self.radius @ (theirs + other.radius)
        return Ball(self.mid @ other.mid, _widened(radius * (1 + error)))

    def sum(self, dim: int) -> "Ball":
        """Sum along one axis."""
        error = _summation_error(self.mid.shape[dim])
        radius = (self.radius + error * self.mid.abs()).sum(dim)
        return Ball(self.mid.sum(dim), _widened(radius * (1 + error)))

    def enlarged(self, reach: Tensor) -> "Ball":
        """With a larger radius; a reach computed by fewer than 60 operations needs no error of its own."""
        return Ball(self.mid, _widened((self.radius + reach) * SLACK))

    def tightest(self, other: "Ball") -> "Ball":
        """Of two balls that contain the same number, the smaller one, entry by entry."""
        mine = self.radius <= other.radius
        return Ball(torch.where(mine, self.mid, other.mid), torch.where(mine, self.radius, other.radius))


def linear(weight: Tensor, x: Ball) -> Ball:
    """x Wᵀ for a matrix without error."""
    error = _summation_error(weight.shape[1])
    radius = (x.radius + error * x.mid.abs()) @ weight.T.abs()
    return Ball(x.mid @ weight.T, _widened(radius * (1 + error)))


def _summation_error(terms: int) -> float:
    """Twice γ_n for n products and their sum: generous, since it costs nothing that matters."""
    return 2 * (terms + 2) * ROUND_OFF


def _widened(radius: Tensor, error: Tensor | float = 0.0) -> Tensor:
    return (radius + error) * SLACK + UNDERFLOW
