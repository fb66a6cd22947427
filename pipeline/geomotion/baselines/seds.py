"""Mixtures of linear systems that are stable for all parameters: SEDS."""

import math

import torch
from torch import nn

from geomotion.baselines.clusters import nearest_centres
from geomotion.dynamics.linear import contracting_matrix
from geomotion.types import Curves, Float, State, Tensor, Velocity

SMALLEST_STD = 1e-2  # of a component at the start, in units of the data


class StableGaussianMixture(nn.Module):
    r"""Gaussian mixture regression of velocities on states, constrained to be stable at the origin.

    .. math:: f(x) = \sum_k h_k(x)\, A_k x, \qquad
        h_k(x) = \frac{\pi_k N(x; \mu_k, \Sigma_k)}{\sum_j \pi_j N(x; \mu_j, \Sigma_j)}, \qquad
        \operatorname{sym} A_k \preceq -\tau I

    The paper optimises under nonlinear constraints, A_k + A_kᵀ ≺ 0 and Σ_k ≻ 0 among them. Here
    A_k = -(BᵀB + τI) + S - Sᵀ, Σ_k⁻¹ = RᵀR and π = softmax(·) fulfil them for all parameters, so any optimiser will do.
    The objective is the paper's mean squared error, for which covariances of velocities play no part.

    Args:
        dim: D.
        components: K.
        min_rate: τ > 0, per time unit.

    Source: Khansari-Zadeh and Billard, 2011, SEDS-MSE.
    """

    claim = (
        "SEDS claims global asymptotic stability: every matrix of the mixture has a negative definite symmetric part, "
        "so the distance to the goal falls along every trajectory. Nothing is claimed about the distance between two "
        "trajectories, because the weights of the mixture change with the state."
    )

    def __init__(self, dim: int, components: int, min_rate: float) -> None:
        super().__init__()
        self.dim = dim
        self.min_rate = min_rate
        eye = torch.eye(dim).repeat(components, 1, 1)
        self.log_priors = nn.Parameter(torch.zeros(components))
        self.means = nn.Parameter(0.5 * torch.randn(components, dim))
        self.state_root = nn.Parameter(torch.zeros_like(eye))
        self.symmetric_root = nn.Parameter(eye.clone())
        self.skew_root = nn.Parameter(torch.zeros_like(eye))

    @property
    def matrices(self) -> Float[Tensor, "K D D"]:
        """A_k, per time unit."""
        return contracting_matrix(self.symmetric_root, self.skew_root, self.min_rate)

    def forward(self, x: State) -> Velocity:
        velocity: Velocity = torch.einsum("...k,kij,...j->...i", self._log_joint(x).softmax(-1), self.matrices, x)
        return velocity

    def _log_joint(self, x: State) -> Float[Tensor, "*batch K"]:
        """log π_k N(x; μ_k, Σ_k)."""
        return self.log_priors.log_softmax(-1) + gaussian_log_density(x.unsqueeze(-2) - self.means, self.state_root)

    @torch.no_grad()
    def start_from(self, times: Curves, states: Curves, velocities: Curves) -> None:
        """Begin with one component for each cluster of what was shown, each made stable."""
        x, velocity = torch.cat([*states]), torch.cat([*velocities])
        scale = velocity.std() / x.std()
        member = nearest_centres(torch.cat([x, velocity / scale], dim=-1), len(self.means))
        eye = torch.eye(self.dim)
        for k in range(len(self.means)):
            own, moving = x[member == k], velocity[member == k]
            mean = own.mean(0)
            matrix = torch.linalg.solve(own.T @ own / len(own) + SMALLEST_STD**2 * eye, own.T @ moving / len(own)).T
            symmetric, skew = (matrix + matrix.T) / 2, (matrix - matrix.T) / 2
            rates, axes = torch.linalg.eigh(-symmetric)
            self.symmetric_root[k] = (rates - self.min_rate).clamp(min=0.1).sqrt()[:, None] * axes.T
            self.skew_root[k] = skew / 2
            self.log_priors[k] = math.log(len(own) / len(x))
            self.means[k] = mean
            self.state_root[k] = inverse_root((own - mean).T @ (own - mean) / len(own) + SMALLEST_STD**2 * eye)


def gaussian_log_density(
    offset: Float[Tensor, "*batch K D"], root: Float[Tensor, "K D D"]
) -> Float[Tensor, "*batch K"]:
    """Log density of N(0, (RᵀR)⁻¹), R lower triangular with the exponentials of the given diagonal on its own."""
    log_diagonal = root.diagonal(dim1=-2, dim2=-1)
    factor = root.tril(-1) + log_diagonal.exp().diag_embed()
    whitened = torch.einsum("kij,...kj->...ki", factor, offset)
    normaliser = log_diagonal.sum(-1) - offset.shape[-1] / 2 * math.log(2 * math.pi)
    density: Tensor = normaliser - whitened.square().sum(-1) / 2
    return density


def inverse_root(covariance: Float[Tensor, "D D"]) -> Float[Tensor, "D D"]:
    """What :func:`gaussian_log_density` takes, of a covariance."""
    factor = torch.linalg.inv(torch.linalg.cholesky(covariance))
    root: Tensor = factor.tril(-1) + factor.diagonal().log().diag_embed()
    return root
