"""How densely latent space is covered by encoded demonstrations, as a conformal factor of the metric."""

from collections.abc import Sequence

import torch

from geomotion.types import Float, Tensor

REFERENCE_QUANTILE = 0.9
LARGEST_FACTOR = 1e5
SMALLEST_FACTOR = 1e-2
CODES_AT_ONCE = 2000  # compared with all others in one batch


class DensityFactor:
    r"""f(z) = clip((ρ₉₀ / ρ(z))^p, 0.01, 1e5), ρ a Gaussian kernel density of the encoded demonstrations.

    f²M is again a Riemannian metric. Plain geodesics take the inner edge of the tube that demonstrations span; with f
    they keep to where demonstrations are dense.

    Args:
        codes: Encoded demonstrations.
        bandwidth: Standard deviation of the kernels.
        power: p; 0 gives the thesis' metric.
    """

    def __init__(self, codes: Float[Tensor, "point d"], bandwidth: float, power: float) -> None:
        self.codes, self._precision, self._power = codes, 0.5 / bandwidth**2, power
        self._from_codes = -self._precision * (codes * codes).sum(dim=-1)
        densities = torch.cat([self._log_sum(part) for part in torch.split(codes, CODES_AT_ONCE)])
        self._log_reference = torch.quantile(densities, REFERENCE_QUANTILE)

    def __call__(self, z: Float[Tensor, "*batch d"]) -> Float[Tensor, "*batch"]:
        if self._power == 0:
            return torch.ones_like(z[..., 0])
        log_factor = self._power * (self._log_reference - self._log_sum(z))
        return log_factor.exp().clamp(SMALLEST_FACTOR, LARGEST_FACTOR)

    def _log_sum(self, z: Float[Tensor, "*batch d"]) -> Float[Tensor, "*batch"]:
        """log of the sum of all kernels: the density but for a constant."""
        squares = (z * z).sum(dim=-1)  # the same for all codes, so left to the end: one matrix of codes is enough
        points = z.reshape(-1, z.shape[-1])
        exponents = torch.addmm(self._from_codes, points, self.codes.T, alpha=2 * self._precision)
        return torch.logsumexp(exponents, dim=-1).reshape(squares.shape) - self._precision * squares


class GroupedDensity:
    """The smallest factor of several groups of demonstrations: that of the group that covers a point best.

    Groups weigh the same, however many demonstrations they have and however far these lie apart.

    Args:
        factors: One for each group.
    """

    def __init__(self, factors: Sequence[DensityFactor]) -> None:
        self._factors = tuple(factors)

    def __call__(self, z: Float[Tensor, "*batch d"]) -> Float[Tensor, "*batch"]:
        return torch.stack([factor(z) for factor in self._factors]).amin(dim=0)


def mean_distance_between(codes: Sequence[Float[Tensor, "_ d"]], groups: Sequence[int]) -> float:
    """Mean latent distance from the points of a demonstration to the nearest of another one of its group.

    The natural bandwidth of :class:`DensityFactor`. Where no group has two demonstrations that differ, the spacing of
    points.
    """
    nearest = [
        torch.cdist(one, other).amin(dim=1).mean()
        for number, one in enumerate(codes)
        for another, other in enumerate(codes)
        if number != another and groups[number] == groups[another]
    ]
    between = float(torch.stack(nearest).mean()) if nearest else 0.0
    return between or float(torch.cat([one.diff(dim=0).norm(dim=1) for one in codes]).mean())
