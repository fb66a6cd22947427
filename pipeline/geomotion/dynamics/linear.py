"""Linear systems that contract for every value of their parameters, with closed-form trajectories."""

import torch
from torch import nn

from geomotion.types import Float, State, Tensor, Times, Trajectories, Velocity


class LinearField(nn.Module):
    r"""ż = A z with sym A ≼ -τI for all parameters; its equilibrium is the origin.

    .. math:: A = -(B^\top B + \tau I) + (S - S^\top)

    Two trajectories approach each other at least as fast as e^{-τt}, because the derivative of ‖z - z'‖²/2 is
    (z - z')ᵀ sym(A) (z - z') ≤ -τ ‖z - z'‖².

    Args:
        dim: D.
        min_rate: τ, per time unit.
        initial_rate: Rate at the start of training, above τ; A starts as -initial_rate I.
    """

    def __init__(self, dim: int, min_rate: float, initial_rate: float) -> None:
        super().__init__()
        self.dim = dim
        self.min_rate = min_rate
        eye = torch.eye(dim)
        self.symmetric_root = nn.Parameter((initial_rate - min_rate) ** 0.5 * eye)
        self.skew_root = nn.Parameter(torch.zeros_like(eye))

    @property
    def matrix(self) -> Float[Tensor, "D D"]:
        """A, per time unit."""
        root = self.symmetric_root
        symmetric = root.T @ root + self.min_rate * torch.eye(self.dim, dtype=root.dtype, device=root.device)
        return self.skew_root - self.skew_root.T - symmetric

    @property
    def rate(self) -> float:
        """Contraction rate -λ_max(sym A) ≥ τ, per time unit."""
        matrix = self.matrix.detach().double()
        return -float(torch.linalg.eigvalsh((matrix + matrix.T) / 2).max())

    def forward(self, z: State) -> Velocity:
        return z @ self.matrix.T

    def solve(self, start: State, times: Times) -> Trajectories:
        """e^{At} z_0, shape (*batch, time, D)."""
        return torch.einsum("tij,...j->...ti", matrix_exponentials(self.matrix, times), start)


def matrix_exponentials(matrix: Float[Tensor, "D D"], times: Times) -> Float[Tensor, "time D D"]:
    """e^{At} for many times, differentiable in A."""
    return torch.linalg.matrix_exp(matrix * times[:, None, None])
