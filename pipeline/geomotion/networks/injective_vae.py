"""Variational auto-encoder whose decoder is injective and whose encoder is its approximate inverse."""

import torch
from torch import nn

from geomotion.dynamics.injective import DecoderChart
from geomotion.networks.mlp import MLP
from geomotion.types import Float, Latent, State, Tensor

LOG_VARIANCE_RANGE = (-14.0, 4.0)
INITIAL_LOG_VARIANCE = -4.0  # of the posterior: a code that is mostly noise would teach the decoder nothing


class InjectiveVAE(nn.Module):
    r"""Posterior :math:`N(\mu^{\sim 1}(x), \operatorname{diag} \sigma^2(x))` around what the decoder's inverse says.

    Since ι⁻¹ is a bijection, σ takes ι⁻¹(x), which has been computed for the mean, in place of x.

    Args:
        decoder: μ and its approximate inverse.
        units: Width of the two hidden layers of σ.

    Source: Thesis Eq. (6.1), (6.2).
    """

    def __init__(self, decoder: DecoderChart, units: int) -> None:
        super().__init__()
        self.decoder = decoder
        self.spread = MLP(decoder.dim, decoder.latent_dim, [units, units])
        self.spread.start_at(torch.full((decoder.latent_dim,), INITIAL_LOG_VARIANCE))

    def encode(self, x: State) -> tuple[Latent, Float[Tensor, "*batch d"]]:
        """Mean and log-variance of the posterior."""
        code, offset = self.decoder.split(x)
        log_variance: Tensor = self.spread(torch.cat([code, offset], dim=-1))
        return code, log_variance.clamp(*LOG_VARIANCE_RANGE)

    def decode(self, z: Latent) -> State:
        """μ(z)."""
        return self.decoder.to_ambient(z)
