"""Linear systems that contract for every value of their parameters, with closed-form trajectories."""

import torch
from torch import nn

from geomotion.types import Float, State, Tensor, Trajectories, Velocity

DOUBLE_EIGENVALUE = 1e-8  # squared distance of two eigenvalues from their mean, below which a series is used


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

    def solve(self, start: State, times: Float[Tensor, "*#batch time"]) -> Trajectories:
        """e^{At} z_0, shape (*batch, time, D).

        Args:
            start: z_0.
            times: Times of all trajectories, shape (time,), or of each one, shape (*batch, time).
        """
        return torch.einsum("...tij,...j->...ti", matrix_exponentials(self.matrix, times), start)


def matrix_exponentials(
    matrix: Float[Tensor, "D D"], times: Float[Tensor, "*batch time"]
) -> Float[Tensor, "*batch time D D"]:
    """e^{At} for many times, differentiable in A; in closed form for 2x2 matrices, ten times faster."""
    if len(matrix) != 2:
        series: Tensor = torch.linalg.matrix_exp(matrix * times[..., None, None])
        return series
    # A = mean I + N with N² = discriminant I (Cayley-Hamilton), so e^{At} = e^{mean t} (cosh(rt) I + sinh(rt)/r N)
    eye = torch.eye(2, dtype=matrix.dtype, device=matrix.device)
    mean = matrix.diagonal().mean()
    rest = matrix - mean * eye
    discriminant = -torch.linalg.det(rest)
    even, odd = _even_and_odd_parts(mean, discriminant, times)
    return even[..., None, None] * eye + odd[..., None, None] * rest


def _even_and_odd_parts(mean: Tensor, discriminant: Tensor, times: Tensor) -> tuple[Tensor, Tensor]:
    """e^{mean t} cosh(rt) and e^{mean t} sinh(rt)/r for r² = discriminant of either sign."""
    if abs(float(discriminant.detach())) < DOUBLE_EIGENVALUE:
        decay, square = (mean * times).exp(), discriminant * times.square()
        return decay * (1 + square / 2), decay * times * (1 + square / 6)
    if discriminant > 0:  # one exponential of each eigenvalue: cosh alone would overflow where the product does not
        root = discriminant.sqrt()
        slow, fast = ((mean + root) * times).exp(), ((mean - root) * times).exp()
        return (slow + fast) / 2, (slow - fast) / (2 * root)
    root, decay = (-discriminant).sqrt(), (mean * times).exp()
    return decay * (root * times).cos(), decay * (root * times).sin() / root
