"""The von Mises-Fisher distribution on spheres, in forms that stay finite for every concentration."""

import math

import torch

from geomotion.errors import ShapeMismatch
from geomotion.types import Float, Tensor

SERIES_BELOW = 0.01  # κ; the terms of the closed forms go to infinity there, and so does the error of their derivative


def log_normaliser(concentration: Float[Tensor, "*batch"], dim: int) -> Float[Tensor, "*batch"]:
    r"""log C_D(κ) + κ, where C_D is the normalisation of Eq. (3.4).

    The density is :math:`\exp(\log C_D(\kappa) + \kappa \mu^\top q)`; with κ added here and
    :math:`\kappa(\mu^\top q - 1)` in the exponent, nothing overflows. At κ = 0 the density is that of the uniform
    distribution.

    Args:
        concentration: κ ≥ 0.
        dim: D, the length of the unit vectors: 3 for directions, 4 for quaternions.

    Raises:
        ShapeMismatch: For other dimensions.

    Source: Thesis Eq. (3.4), with I_{1/2} and I_1 in closed form and exponentially scaled.
    """
    small, kappa = concentration.clamp(max=SERIES_BELOW), concentration.clamp(min=SERIES_BELOW)
    match dim:
        case 3:  # I_{1/2}(κ) = √(2/πκ) sinh κ
            closed = kappa.log() - torch.log(-torch.expm1(-2 * kappa)) - math.log(2 * math.pi)
            log_area = math.log(4 * math.pi)
        case 4:
            closed = kappa.log() - torch.special.i1e(kappa).log() - 2 * math.log(2 * math.pi)
            log_area = math.log(2 * math.pi**2)
        case _:
            raise ShapeMismatch("unit vectors of a von Mises-Fisher distribution", "3 or 4 components", dim)
    series = small - small**2 / (2 * dim) + small**4 / (4 * dim**2 * (dim + 2)) - log_area
    return torch.where(concentration < SERIES_BELOW, series, closed)


def log_density(
    q: Float[Tensor, "*batch D"], mean: Float[Tensor, "*batch D"], concentration: Float[Tensor, "*batch"]
) -> Float[Tensor, "*batch"]:
    """Log-density at unit vectors.

    Args:
        q: Unit vectors.
        mean: Mean directions μ.
        concentration: κ.

    Source: Thesis Eq. (3.3).
    """
    alignment = (q * mean).sum(dim=-1)
    return log_normaliser(concentration, q.shape[-1]) + concentration * (alignment - 1)


def antipodal_log_density(
    q: Float[Tensor, "*batch D"], mean: Float[Tensor, "*batch D"], concentration: Float[Tensor, "*batch"]
) -> Float[Tensor, "*batch"]:
    """Log-density of the mixture of μ and -μ in equal parts: the same for q and -q.

    Source: Thesis Eq. (3.5).
    """
    alignment = (q * mean).sum(dim=-1)
    mixed = torch.logaddexp(concentration * (alignment - 1), -concentration * (alignment + 1)) - math.log(2)
    return log_normaliser(concentration, q.shape[-1]) + mixed
