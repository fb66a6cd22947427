"""Curves over a span of time that end at rest at zero."""

import torch
from torch import nn

from geomotion.manifolds.grid_spline import CUBIC_B_SPLINES
from geomotion.types import Float, Tensor

BESIDE = 3  # basis functions of a cubic spline, beyond one for each interval
AT_START = (1 / 6, 4 / 6, 1 / 6)  # weights of the first three coefficients in the first value
AT_REST = (1.0, -0.5, 1.0)  # the last three of what ends at rest at zero, up to a factor


class FadingSpline(nn.Module):
    """A uniform cubic spline over [0, 1] with values in R^D: constant before, zero afterwards.

    Args:
        dim: D.
        intervals: Between knots, at least 4.
    """

    coefficients: Tensor
    basis: Tensor

    def __init__(self, dim: int, intervals: int) -> None:
        super().__init__()
        self.intervals = intervals
        self.register_buffer("coefficients", torch.zeros(intervals + BESIDE, dim))
        self.register_buffer("basis", torch.tensor(CUBIC_B_SPLINES, dtype=torch.float32).view(4, 8), persistent=False)

    @torch.no_grad()
    def fit(self, values: Float[Tensor, "point D"]) -> None:
        """Come as near as possible to values at equal distances over [0, 1], meeting the first; the last is zero."""
        shares = torch.linspace(0, 1, len(values), dtype=torch.float64)
        first, weights = self._weights(shares, self.basis.double())
        design = torch.zeros(len(values), self.intervals + BESIDE, dtype=torch.float64)
        design.scatter_(1, first[:, None] + torch.arange(4), weights[:, :4])
        start = torch.zeros(self.intervals + BESIDE, values.shape[1], dtype=torch.float64)
        start[0] = values[0] / AT_START[0]
        free = self._free()
        # of all that are as near, the smallest: there may be fewer values than coefficients
        found = torch.linalg.lstsq(design @ free, values.double() - design @ start, driver="gelsd").solution
        self.coefficients.copy_(start + free @ found)

    def at(self, share: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch D"]:
        """Values."""
        return self._combined(share, slice(0, 4))

    def rate(self, share: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch D"]:
        """Derivatives; in 0, those of what comes."""
        return (share >= 0)[..., None] * self.intervals * self._combined(share, slice(4, 8))

    def _combined(self, share: Float[Tensor, "*batch"], part: slice) -> Tensor:
        first, weights = self._weights(share, self.basis)
        around = self.coefficients[first[..., None] + torch.arange(4, device=first.device)]
        return (weights[..., None, part] @ around)[..., 0, :]

    def _weights(self, share: Tensor, basis: Tensor) -> tuple[Tensor, Tensor]:
        """Which coefficient is the first of four that count, and their weights for values and derivatives."""
        place = share.clamp(0, 1) * self.intervals
        knot = place.detach().nan_to_num().floor().clamp(max=self.intervals - 1)
        within = place - knot
        powers = torch.stack([torch.ones_like(within), within, within**2, within**3], dim=-1)
        return knot.long(), powers @ basis / 6

    def _free(self) -> Float[Tensor, "coefficient free"]:
        """Directions in which coefficients may change, the first value staying."""
        free = torch.eye(self.intervals + BESIDE, dtype=torch.float64)[:, 1:-2]
        free[0, :2] = -torch.tensor(AT_START[1:], dtype=torch.float64) / AT_START[0]
        free[-BESIDE:, -1] = torch.tensor(AT_REST, dtype=torch.float64)
        return free
