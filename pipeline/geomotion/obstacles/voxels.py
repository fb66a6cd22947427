"""Distances tabulated on a regular grid, and what surely holds between its nodes."""

from math import ceil

import numpy as np
import torch
from torch import nn
from torch.nn.functional import grid_sample

from geomotion.types import Bool, Float, Tensor

Vector = Float[np.ndarray, " D"]
Points = Float[np.ndarray, "point D"]


class Nodes:
    """The nodes of a regular grid in two or three dimensions.

    Args:
        low: One corner of a box that the grid covers [m].
        high: The opposite one [m].
        step: Distance between neighbours [m].
        margin: What the grid covers beyond the box, at least [m].

    Attributes:
        points: In the order of an array of the grid's shape, the last coordinate running fastest [m].
    """

    def __init__(self, low: Vector, high: Vector, step: float, margin: float) -> None:
        self.step = step
        self.shape = tuple(ceil(side / step) + 1 for side in high - low + 2 * margin)
        self.low = (low + high - step * (np.array(self.shape) - 1)) / 2
        self.high = (low + high + step * (np.array(self.shape) - 1)) / 2
        axes = [start + step * np.arange(count) for start, count in zip(self.low, self.shape, strict=True)]
        self.points: Points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(low))


class Grid(nn.Module):
    r"""Lower bounds of the distance to a set, from values at nodes that are not larger than it.

    From :math:`\sum_i w_i \|x_i - p\| \le \sqrt{\|x - p\|^2 + \sum_i w_i \|x_i - x\|^2}` with the point p of the set
    nearest to x, nodes :math:`x_i` and weights :math:`w_i`, an interpolated distance exceeds neither
    :math:`\sqrt{d^2 + D h^2/4}` nor :math:`d + \sqrt{D} h/2`, with the step h in D dimensions. The answer is the
    smallest d that explains the interpolated value. Values that are negative inside give negative answers there.
    """

    low: Tensor
    high: Tensor
    values: Tensor

    def __init__(self, nodes: Nodes, values: Float[np.ndarray, "*shape"]) -> None:
        super().__init__()
        self.excess = float(np.sqrt(len(nodes.shape) / 4)) * nodes.step
        self.register_buffer("low", torch.from_numpy(nodes.low))
        self.register_buffer("high", torch.from_numpy(nodes.high))
        self.register_buffer("values", torch.from_numpy(values)[None, None])

    def covers(self, x: Float[Tensor, "point D"]) -> Bool[Tensor, " point"]:
        """Which states lie between the nodes."""
        return ((x >= self.low) & (x <= self.high)).all(dim=-1)

    def forward(self, x: Float[Tensor, "point D"]) -> Float[Tensor, " point"]:
        place = (2 * (x - self.low) / (self.high - self.low) - 1).flip(-1)
        place = place.reshape(*[1] * len(self.low), *x.shape)
        found = grid_sample(self.values, place, align_corners=True).reshape(-1)
        outside = (found.square() - self.excess**2).clamp(min=0).sqrt()
        return torch.where(found > self.excess, outside, found - self.excess)
