"""Variational auto-encoder of poses: Gaussian positions and von Mises-Fisher orientations over one latent space."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import nn
from torch.nn.functional import normalize

from geomotion.networks.mlp import MLP
from geomotion.networks.rbf import RadialBasisNetwork
from geomotion.types import Float, Tensor

LOG_VARIANCE_RANGE = (-14.0, 4.0)
TYPICAL_STD = 0.03  # where the spreads start, in units of the data's size
TYPICAL_CONCENTRATION = 1000.0
SPREADS = ("precision", "concentration")  # parts of networks that are fitted after the means


@dataclass(frozen=True)
class DecodedPose:
    """Means of the decoder.

    Attributes:
        position: Scaled positions, shape (*batch, Dx) [position_scale].
        orientation: Unit vectors, shape (*batch, Dq).
        progress: Share of the motion that is done, shape (*batch,); about 0 to 1.
    """

    position: Float[Tensor, "*batch Dx"]
    orientation: Float[Tensor, "*batch Dq"]
    progress: Float[Tensor, "*batch"]


class PoseVAE(nn.Module):
    """Encoder, decoder of the means, and the spread of positions and orientations as radial basis networks.

    Beyond the thesis, poses carry their progress along the demonstration: it is encoded and decoded with them, which
    keeps parts of a motion apart that pass through the same pose.

    Args:
        position_dim: Dx.
        orientation_dim: Dq: 4 for quaternions, 3 for directions.
        latent_dim: d.
        hidden_units: Widths of the encoder's hidden layers; the decoder has them in reverse.
        kernels: Of each radial basis network.
        largest_std: σ far from the data [position_scale].
        smallest_concentration: κ far from the data.
        encodes_progress: Whether the encoder sees the progress; the thesis has none.

    Source: Thesis Eq. (3.1)-(3.5), Sec. 3.5.5.
    """

    def __init__(
        self,
        position_dim: int,
        orientation_dim: int,
        latent_dim: int,
        hidden_units: Sequence[int],
        kernels: int,
        largest_std: float,
        smallest_concentration: float,
        encodes_progress: bool = True,
    ) -> None:
        super().__init__()
        self.position_dim, self.orientation_dim, self.latent_dim = position_dim, orientation_dim, latent_dim
        self.encodes_progress = encodes_progress
        ambient_dim = position_dim + orientation_dim
        self.encoder = MLP(ambient_dim + 1, 2 * latent_dim, hidden_units)
        self.decoder = MLP(latent_dim, ambient_dim + 1, tuple(reversed(hidden_units)))
        self.precision = RadialBasisNetwork(kernels, latent_dim, 1 / largest_std)
        self.concentration = RadialBasisNetwork(kernels, latent_dim, smallest_concentration)

    def encode(
        self, pose: Float[Tensor, "*batch D"], progress: Float[Tensor, "*batch"]
    ) -> tuple[Float[Tensor, "*batch d"], Float[Tensor, "*batch d"]]:
        """Mean and log-variance of the approximate posterior."""
        centred = (2 * progress[..., None] - 1) * self.encodes_progress
        mean, log_variance = self.encoder(torch.cat([pose, centred], dim=-1)).chunk(2, dim=-1)
        return mean, log_variance.clamp(*LOG_VARIANCE_RANGE)

    def decode(self, z: Float[Tensor, "*batch d"]) -> DecodedPose:
        """Means at latent points; the orientation is projected to the sphere."""
        output = self.decoder(z)
        position, orientation, progress = torch.split(output, [self.position_dim, self.orientation_dim, 1], dim=-1)
        return DecodedPose(position, normalize(orientation, dim=-1), progress[..., 0])

    def reconstruct(self, z: Float[Tensor, "*batch d"]) -> tuple[Float[Tensor, "*batch D"], Float[Tensor, "*batch"]]:
        """Means at latent points as one vector, and the progress."""
        decoded = self.decode(z)
        return torch.cat([decoded.position, decoded.orientation], dim=-1), decoded.progress

    def blocks(
        self, z: Float[Tensor, "*batch d"], raw: bool = False
    ) -> tuple[Float[Tensor, "*batch 1 P"], Float[Tensor, "*batch Q"]]:
        """What the metric is pulled back from: the position's block, and the orientation's."""
        return self.embed_position(z)[..., None, :], self.embed_orientation(z, raw)

    def place_kernels(self, centres: Float[Tensor, "kernel d"], width: float) -> None:
        """Put the kernels of both spreads there."""
        self.precision.place(centres, width, 1 / TYPICAL_STD)
        self.concentration.place(centres, width, TYPICAL_CONCENTRATION)

    def std(self, z: Float[Tensor, "*batch d"]) -> Float[Tensor, "*batch"]:
        """σ of every coordinate of the position [position_scale]."""
        std: Tensor = self.precision(z).reciprocal()
        return std

    def embed_position(self, z: Float[Tensor, "*batch d"]) -> Float[Tensor, "*batch P"]:
        r"""μ and √Dx σ side by side: their Jacobian J gives the position part JᵀJ of the metric, (3.10) and (3.11)."""
        spread = math.sqrt(self.position_dim) * self.std(z)
        return torch.cat([self.decode(z).position, spread[..., None]], dim=-1)

    def embed_orientation(self, z: Float[Tensor, "*batch d"], raw: bool = False) -> Float[Tensor, "*batch Q"]:
        r"""Mean direction and spread side by side, (3.12) and (3.13).

        The spread is √((Dq - 1)/κ), the root mean square angle of the distribution: a length on the sphere as μ_q is.
        κ itself, as printed in (3.13), is in the thousands near the data and nearly zero elsewhere, so that its
        Jacobian is largest inside the data and swamps everything else; `raw` asks for it all the same.
        """
        dim = self.orientation_dim - 1
        concentration = self.concentration(z)
        spread = math.sqrt(self.orientation_dim) * concentration if raw else (dim / concentration).sqrt()
        return torch.cat([self.decode(z).orientation, spread[..., None]], dim=-1)
