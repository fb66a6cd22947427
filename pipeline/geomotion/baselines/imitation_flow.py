"""Stochastic dynamics in a flow's coordinates: the field of Imitation flow."""

import math

import torch
from torch import nn

from geomotion.dynamics.linear import matrix_exponentials
from geomotion.types import Float, State, Tensor, Velocity

INITIAL_DISTANCE = 100.0  # by how much the distance to the goal falls over the mean duration, at the start of training
STEEPNESS = 100.0  # of the saturated drift, which is linear within 1 / STEEPNESS of the goal


class StochasticDrift(nn.Module):
    r"""The drift of dz = K a(z) dt + diag(σ) dW, with a(z) = z, or a(z) = tanh(100 z) element by element.

    The matrix K is free, as it is for the authors: whether it is Hurwitz is for training to decide.

    Args:
        dim: D.
        is_saturated: Which a.
        initial_std: σ at the start, per root of a time unit.

    Source: Urain, Ginesi, Tateo and Peters, 2020, ImitationFlow.
    """

    def __init__(self, dim: int, is_saturated: bool, initial_std: float) -> None:
        super().__init__()
        self.dim = dim
        self.is_saturated = is_saturated
        rate = 1.0 if is_saturated else math.log(INITIAL_DISTANCE)
        self.matrix = nn.Parameter(-rate * torch.eye(dim))
        self.log_std = nn.Parameter(torch.full((dim,), math.log(initial_std)))

    @property
    def claim(self) -> str:
        """What the method promises, and what of it came true."""
        matrix = self.matrix.detach().double()
        real = float(torch.linalg.eigvals(matrix).real.max())
        symmetric = float(torch.linalg.eigvalsh((matrix + matrix.T) / 2).max())
        text = (
            "Imitation flow claims a stable stochastic system where the matrix of its drift is Hurwitz, which nothing "
            f"in its training enforces; here its largest eigenvalue has the real part {real:.3g} per duration."
        )
        if self.is_saturated:
            return f"{text} Where the drift saturates, neighbouring trajectories stay as far apart in z as they are."
        return (
            f"{text} The drift is linear, so it contracts in z if the symmetric part of that matrix is negative "
            f"definite, and nowhere otherwise: its largest eigenvalue is {symmetric:.3g} per duration."
        )

    def forward(self, z: State) -> Velocity:
        return (torch.tanh(STEEPNESS * z) if self.is_saturated else z) @ self.matrix.T

    def log_transition(self, z: State, later: State, duration: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """Log density of a state some time after another, the noise in between summed up.

        The mean is exact where the drift is linear, and one Euler step where it is saturated.
        """
        if self.is_saturated:
            mean = z + duration[..., None] * self(z)
        else:
            flow = matrix_exponentials(self.matrix, duration[..., None])[..., 0, :, :]
            mean = (flow @ z.unsqueeze(-1)).squeeze(-1)
        std = self.log_std.exp() * duration.sqrt()[..., None]
        density: Tensor = (-((later - mean) / std).square() / 2 - std.log() - math.log(2 * math.pi) / 2).sum(-1)
        return density
