"""Linear systems whose matrix depends on a condition and contracts for every one."""

import torch
from torch import nn

from geomotion.dynamics.linear import LinearField, contracting_matrix, matrix_exponentials
from geomotion.types import Float, State, Tensor, Trajectories, Velocity


class ConditionalLinear(nn.Module):
    r"""(z, c) ↦ (A(c) z, 0) with sym A(c) ≼ -τI for every c and all parameters.

    .. math:: A(c) = -(B(c)^\top B(c) + \tau I) + S(c) - S(c)^\top

    B and S are linear in c.

    Args:
        dim: D.
        context: K, entries of c, which add up to one.
        min_rate: τ, per time unit.
        initial_rate: Rate at the start of training, above τ; every A(c) starts as -initial_rate I.
    """

    def __init__(self, dim: int, context: int, min_rate: float, initial_rate: float) -> None:
        super().__init__()
        self.context = context
        self.dim = dim + context
        one = LinearField(dim, min_rate, initial_rate)
        self.min_rate = min_rate
        self.symmetric_roots = nn.Parameter(one.symmetric_root.detach().repeat(context, 1, 1))
        self.skew_roots = nn.Parameter(one.skew_root.detach().repeat(context, 1, 1))

    def given(self, condition: Float[Tensor, " K"]) -> LinearField:
        """ż = A(c) z for a fixed condition, independent of this field."""
        field = LinearField(self.dim - self.context, self.min_rate, self.min_rate).to(condition)
        with torch.no_grad():
            field.symmetric_root.copy_(_mixed(self.symmetric_roots, condition))
            field.skew_root.copy_(_mixed(self.skew_roots, condition))
        return field

    def forward(self, x: State) -> Velocity:
        z, condition = x[..., : -self.context], x[..., -self.context :]
        velocity = (self._matrices(condition) @ z[..., None]).squeeze(-1)
        return torch.cat([velocity, torch.zeros_like(condition)], -1)

    def solve(self, start: State, times: Float[Tensor, "*#batch time"]) -> Trajectories:
        """e^{A(c)t} z_0 beside c, shape (*batch, time, D + K)."""
        z, condition = start[..., : -self.context], start[..., -self.context :]
        exponentials = matrix_exponentials(self._matrices(condition), times)
        moving = torch.einsum("...tij,...j->...ti", exponentials, z)
        return torch.cat([moving, condition[..., None, :].expand(*moving.shape[:-1], -1)], -1)

    def _matrices(self, condition: Float[Tensor, "*batch K"]) -> Float[Tensor, "*batch D D"]:
        """A(c), per time unit."""
        roots = _mixed(self.symmetric_roots, condition), _mixed(self.skew_roots, condition)
        return contracting_matrix(*roots, self.min_rate)


def _mixed(roots: Float[Tensor, "K D D"], condition: Float[Tensor, "*batch K"]) -> Float[Tensor, "*batch D D"]:
    """Σ cₖ Rₖ."""
    mixed: Tensor = (condition @ roots.flatten(1)).unflatten(-1, roots.shape[1:])  # type: ignore[no-untyped-call]
    return mixed
