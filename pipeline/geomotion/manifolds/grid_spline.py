"""Values at the nodes of a planar grid, joined twice continuously differentiably."""

import numpy as np
import torch
from scipy.ndimage import spline_filter
from torch import nn

from geomotion.errors import ShapeMismatch
from geomotion.manifolds.grid import LatentGrid
from geomotion.types import Float, Tensor

Points = Float[Tensor, "*batch 2"]
CUBIC_B_SPLINES = (
    ((1, 4, 1, 0), (-3, 0, 3, 0)),
    ((-3, 0, 3, 0), (6, -12, 6, 0)),
    ((3, -6, 3, 0), (-3, 9, -9, 3)),
    ((-1, 3, -3, 1), (0, 0, 0, 0)),
)  # by power of the share of a cell: six times the values, and the derivatives, of the four that do not vanish there


class GridSpline(nn.Module):
    """The uniform bicubic spline through values at nodes; points outside of the grid count as on its border.

    Args:
        grid: In two dimensions.
        values: Those of several quantities at each node, in the order of the grid's nodes.

    Raises:
        ShapeMismatch: If the grid is not planar, or there is not one row of values for each node.
    """

    low: Tensor
    cell: Tensor
    coefficients: Tensor
    offsets: Tensor
    basis: Tensor

    def __init__(self, grid: LatentGrid, values: Float[np.ndarray, "node k"]) -> None:
        super().__init__()
        if grid.dim != 2:
            raise ShapeMismatch("axes of the grid of a bicubic spline", 2, grid.dim)
        if len(values) != grid.points_per_axis**2:
            raise ShapeMismatch("values of a bicubic spline", f"{grid.points_per_axis**2} rows", len(values))
        self.last, self.stride = grid.points_per_axis - 1, grid.points_per_axis + 2
        inner = [spline_filter(column.reshape(grid.shape), order=3, mode="mirror") for column in values.T]
        padded = np.stack([np.pad(one, 1, mode="reflect").ravel() for one in inner])
        steps = torch.arange(4)
        self.register_buffer("low", torch.from_numpy(grid.low))
        self.register_buffer("cell", torch.from_numpy(grid.cell))
        self.register_buffer("coefficients", torch.from_numpy(padded))
        self.register_buffer("offsets", self.stride * steps[:, None] + steps)
        self.register_buffer("basis", torch.tensor(CUBIC_B_SPLINES, dtype=torch.float64).view(4, 8) / 6)

    def nearest(self, points: Points) -> Points:
        """The points themselves where they lie in the grid's box, otherwise the nearest ones on its border."""
        return torch.minimum(torch.maximum(points, self.low), self.low + self.last * self.cell)

    def forward(self, points: Points) -> tuple[Float[Tensor, "*batch k"], Float[Tensor, "*batch k 2"]]:
        """Values and gradients; across the border, the gradient vanishes."""
        place = ((points - self.low) / self.cell).clamp(0, self.last)
        corner = place.detach().nan_to_num().floor().clamp(max=self.last - 1)  # what is no number is in no cell
        share = place - corner
        powers = torch.stack([torch.ones_like(share), share, share * share, share * share * share], dim=-1)
        rows, columns = (powers @ self.basis).unflatten(-1, (2, 4)).unbind(-3)  # type: ignore[no-untyped-call]
        first = (corner[..., 0] * self.stride + corner[..., 1]).long()
        around = self.coefficients[:, first[..., None, None] + self.offsets].movedim(0, -3)
        found = rows[..., None, :, :] @ around @ columns[..., None, :, :].mT
        gradient = torch.stack([found[..., 1, 0], found[..., 0, 1]], dim=-1) / self.cell
        return found[..., 0, 0], gradient
