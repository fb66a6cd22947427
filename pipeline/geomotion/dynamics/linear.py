"""Linear systems that contract for every value of their parameters, with closed-form trajectories."""

import torch
from torch import nn

from geomotion.types import Float, State, Tensor, Trajectories, Velocity

DOUBLE_EIGENVALUE = 1e-8  # squared distance of two eigenvalues from their mean, below which they count as equal
SLOW_TURN = 1e-6  # imaginary part that equal eigenvalues get


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
        return contracting_matrix(self.symmetric_root, self.skew_root, self.min_rate)

    @property
    def rate(self) -> float:
        """Contraction rate -λ_max(sym A) ≥ τ, per time unit."""
        matrix = self.matrix.detach().double()
        return -float(torch.linalg.eigvalsh((matrix + matrix.T) / 2).max())

    def forward(self, z: State) -> Velocity:
        return z @ self.matrix.T

    def solve(self, start: State, times: Float[Tensor, "*#batch time"]) -> Trajectories:
        """e^{At} z_0, shape (*batch, time, D).

        Args:
            start: z_0.
            times: Times of all trajectories, shape (time,), or of each one, shape (*batch, time).
        """
        return torch.einsum("...tij,...j->...ti", matrix_exponentials(self.matrix, times), start)


def contracting_matrix(
    symmetric_root: Float[Tensor, "*batch D D"], skew_root: Float[Tensor, "*batch D D"], min_rate: float
) -> Float[Tensor, "*batch D D"]:
    """-(BᵀB + τI) + (S - Sᵀ) of B, S and τ."""
    eye = torch.eye(symmetric_root.shape[-1], dtype=symmetric_root.dtype, device=symmetric_root.device)
    return skew_root - skew_root.mT - symmetric_root.mT @ symmetric_root - min_rate * eye


def matrix_exponentials(
    matrix: Float[Tensor, "*#batch D D"], times: Float[Tensor, "*#batch time"]
) -> Float[Tensor, "*batch time D D"]:
    """e^{At} for many times, differentiable in A; in closed form for 2x2 matrices, ten times faster."""
    if matrix.shape[-1] != 2:
        series: Tensor = torch.linalg.matrix_exp(matrix[..., None, :, :] * times[..., None, None])
        return series
    # A = mean I + N with N² = discriminant I (Cayley-Hamilton), so e^{At} = e^{mean t} (cosh(rt) I + sinh(rt)/r N)
    eye = torch.eye(2, dtype=matrix.dtype, device=matrix.device)
    mean = matrix.diagonal(dim1=-2, dim2=-1).mean(-1, keepdim=True)
    rest = matrix - mean[..., None] * eye
    discriminant = (rest[..., 0, 0].square() + rest[..., 0, 1] * rest[..., 1, 0])[..., None]
    even, odd = _even_and_odd_parts(mean, discriminant, times)
    return even[..., None, None] * eye + odd[..., None, None] * rest[..., None, :, :]


def _even_and_odd_parts(mean: Tensor, discriminant: Tensor, times: Tensor) -> tuple[Tensor, Tensor]:
    """e^{mean t} cosh(rt) and e^{mean t} sinh(rt)/r for r² = discriminant of either sign.

    With r = s real or r = iw, both are products of what has s and what has w, of which one is zero.
    """
    is_real = discriminant > DOUBLE_EIGENVALUE
    root = torch.where(discriminant.abs() < DOUBLE_EIGENVALUE, SLOW_TURN**2, discriminant.abs()).sqrt()
    spread, turn = torch.where(is_real, root, 0.0), torch.where(is_real, 0.0, root)
    # of the slower eigenvalue: cosh alone would overflow where the product does not
    slow, gap = ((mean + spread) * times).exp(), -2 * spread * times
    even = slow * (1 + gap.exp()) / 2 * (turn * times).cos()
    odd = slow * (torch.sin(turn * times) - torch.expm1(gap) / 2) / root
    return even, odd
