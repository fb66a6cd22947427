"""Gradient systems of strongly convex potentials, with a constant rotation, that contract for all their parameters."""

import torch
from torch import nn
from torch.nn import functional

from geomotion.dynamics.linear import LinearField
from geomotion.types import Float, State, Tensor, Velocity

REACH = 2.0  # kinks start within this distance of the equilibrium: the scaled demonstrations are about as long
INITIAL_GAIN = 4.0  # sum of Λ at the start: pulls and linear part are then about as strong


class PotentialField(nn.Module):
    r"""ż = -∇φ(z) + S z with φ strongly convex and S skew; contracts for all parameters, equilibrium at the origin.

    .. math:: \dot z = A z - W^\top \Lambda \, (\tanh(W z + b) - \tanh(b)),
        \qquad A = -(B^\top B + \tau I) + S, \qquad \Lambda \succeq 0 \text{ diagonal}

    Its Jacobian is A - Wᵀ Λ diag(tanh′) W with tanh′ ≥ 0, so its symmetric part is at most -(τI + BᵀB) and its skew
    part is S everywhere. φ is a quadratic plus Σ λᵢ (log cosh(wᵢ·z + bᵢ) - tanh(bᵢ) wᵢ·z), whose gradient is known:
    nothing is integrated.

    Unlike a linear field it has more than one time law: each unit pulls along wᵢ with a force that saturates, so that
    speed need not fall in proportion to the distance.

    Args:
        dim: D.
        units: Number of saturating pulls.
        min_rate: τ, per time unit.
        initial_rate: Rate of the linear part at the start of training, above τ.
    """

    def __init__(self, dim: int, units: int, min_rate: float, initial_rate: float) -> None:
        super().__init__()
        self.dim = dim
        self.linear = LinearField(dim, min_rate, initial_rate)
        weight = torch.randn(units, dim)
        kinks = REACH * (2 * torch.rand(units) - 1)
        self.weight = nn.Parameter(weight)
        self.bias = nn.Parameter(kinks * weight.norm(dim=-1))
        gain = torch.full((units,), INITIAL_GAIN / units)
        self.raw_gain = nn.Parameter(gain.expm1().log())  # the inverse of softplus

    @property
    def rate(self) -> float:
        """Contraction rate -λ_max(sym A) ≥ τ, per time unit; the pulls can only add to it."""
        return self.linear.rate

    @property
    def gain(self) -> Float[Tensor, " units"]:
        """Diagonal of Λ, at least 0."""
        return functional.softplus(self.raw_gain)

    def forward(self, z: State) -> Velocity:
        saturation = torch.tanh(z @ self.weight.T + self.bias) - torch.tanh(self.bias)
        linear: Tensor = self.linear(z)
        return linear - (saturation * self.gain) @ self.weight
