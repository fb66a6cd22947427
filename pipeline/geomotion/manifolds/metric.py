"""Riemannian metrics pulled back through a decoder, and their volume."""

from collections.abc import Callable

import torch
from torch.func import jacfwd, vmap

from geomotion.errors import ShapeMismatch
from geomotion.manifolds.immersion import Conformal, Immersion, Latent
from geomotion.types import Float, Tensor

AmbientFactor = Callable[[Tensor], Tensor]
"""Positions (*batch, Dx) [m] → factors m ≥ 1 by which obstacles scale their blocks of the ambient metric."""
SMALLEST_VOLUME = 1e-300


class PullbackMetric:
    r"""M(z) = f(z)² (Σ_b J_bᵀ m(x_b) J_b + J_oᵀ J_o), with the Jacobians of the immersion's blocks.

    Args:
        immersion: Decoder.
        ambient: m of Eq. (3.15), (3.16), (4.4); 1 if omitted.
        conformal: f; 1 if omitted, which is the thesis' metric.

    Source: Thesis Eq. (2.11), (2.13), (3.9)-(3.18), (4.3), (4.4).
    """

    def __init__(
        self, immersion: Immersion, ambient: AmbientFactor | None = None, conformal: Conformal | None = None
    ) -> None:
        self.immersion, self.ambient, self.conformal = immersion, ambient, conformal

    def __call__(self, z: Latent) -> Float[Tensor, "*batch d d"]:
        """Symmetric and positive semi-definite; definite where the decoder is an immersion.

        Raises:
            ShapeMismatch: If the points are not of the latent dimension.
        """
        dim = self.immersion.latent_dim
        if z.shape[-1] != dim:
            raise ShapeMismatch("latent points", f"{dim} coordinates", z.shape[-1])
        points = z.reshape(-1, dim)
        of_position, of_rest = vmap(jacfwd(self.immersion.blocks))(points)
        blocks = of_position.mT @ of_position
        if self.ambient is not None:
            blocks = self.ambient(self.immersion.positions(points))[..., None, None] * blocks
        metric: Tensor = blocks.sum(dim=1) + of_rest.mT @ of_rest
        if self.conformal is not None:
            metric = self.conformal(points).square()[:, None, None] * metric
        return metric.reshape(*z.shape, dim)


def log_magnification(metric: Float[Tensor, "*batch d d"]) -> Float[Tensor, "*batch"]:
    """log √det M: how much latent volume is magnified.

    Ask for it in double precision: float32 loses the determinant in flat regions.

    Source: Thesis Sec. 3.5.2.
    """
    volume: Tensor = torch.linalg.det(metric).clamp(min=SMALLEST_VOLUME)
    return volume.log() / 2
