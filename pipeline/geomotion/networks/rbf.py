"""Radial basis functions: a precision that fades to a floor away from the data."""

import torch
from torch import nn

from geomotion.types import Float, Tensor


class RadialBasisNetwork(nn.Module):
    r"""Positive function of latent points that is large near its kernels and falls to a floor elsewhere.

    .. math:: p(z) = \sum_k w_k \exp(-\|z - c_k\|^2 / 2 h^2) + p_\infty, \qquad w_k > 0

    Args:
        kernels: Number of kernels; they are placed later by :meth:`place`.
        latent_dim: d.
        floor: p_∞ > 0.

    Source: Thesis Sec. 3.4, 3.5.5; Arvanitidis et al. (2018).
    """

    centres: Tensor
    bandwidth: Tensor

    def __init__(self, kernels: int, latent_dim: int, floor: float) -> None:
        super().__init__()
        self.floor = floor
        self.register_buffer("centres", torch.zeros(kernels, latent_dim))
        self.register_buffer("bandwidth", torch.ones(()))
        self.log_weights = nn.Parameter(torch.zeros(kernels))

    def place(self, centres: Float[Tensor, "kernel d"], bandwidth: float, level: float) -> None:
        """Put the kernels somewhere and start with equal weights such that p - p_∞ is `level` where `centres` are.

        Args:
            centres: c.
            bandwidth: h.
            level: Mean of p - p_∞ over the kernels; above zero.
        """
        with torch.no_grad():
            self.centres.copy_(centres)
            self.bandwidth.fill_(bandwidth)
            overlap = float(self._responses(self.centres).sum(dim=-1).mean())
            self.log_weights.fill_(level / overlap).log_()

    def forward(self, z: Float[Tensor, "*batch d"]) -> Float[Tensor, "*batch"]:
        return self._responses(z) @ self.log_weights.exp() + self.floor

    def _responses(self, z: Tensor) -> Tensor:
        # not torch.cdist, which has no forward-mode derivative
        squares = (z * z).sum(dim=-1, keepdim=True) - 2 * z @ self.centres.T + (self.centres * self.centres).sum(dim=-1)
        return torch.exp(-squares.clamp(min=0) / (2 * self.bandwidth**2))
