r"""Safe regions of a latent plane: where the volume of the metric is small.

The volume 𝒱 = √det M grows away from the data and towards obstacles, so that S = α/𝒱 is a distance field: large where
a motion is free, below ρ where it must not go. With several reasons to stay away, each has a volume and an α of its
own, and

.. math:: S = \Big(\sum_i (\mathcal V_i / \alpha_i)^4\Big)^{-1/4} \le \min_i \alpha_i / \mathcal V_i,

which is at most ρ wherever one of them says so, and as smooth as the volumes are.

Source: Thesis Sec. 6.3.
"""

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Int
from scipy.ndimage import distance_transform_edt, gaussian_filter
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from torch import nn

from geomotion.errors import InvalidSetting, MissingData
from geomotion.manifolds.grid import LatentGrid
from geomotion.manifolds.grid_spline import GridSpline
from geomotion.types import Float, Tensor

SHARPNESS = 4  # of the minimum over reasons to stay away
GUARD = 0.01  # of ρ, by which a motion stops before it: room for the error of a step
NARROWEST = 1.1  # ν over where a motion stops, at least
CLEARLY_OUT = 1.05  # ρ over S, from which on there is nothing but the way in, which does not depend on ∇S
DIRECTION_FLOOR = 1e-12  # a shorter gradient has no direction

Points = Float[Tensor, "*batch 2"]
Values = Float[Tensor, "*batch 1"]
NodeValues = Float[np.ndarray, " node"]


@dataclass(frozen=True)
class Levels:
    """How a distance S switches the modulation.

    Attributes:
        impenetrable: ρ, at which nothing gets nearer.
        inactive: ν, from which on nothing is changed.
        steepness: k of the sigmoid.

    Raises:
        InvalidSetting: Unless 0 < 1.01 ρ < ν, and 0 < k.
    """

    impenetrable: float = 1.0
    inactive: float = 10.0
    steepness: float = 2.0

    def __post_init__(self) -> None:
        if not (self.impenetrable > 0 and self.guarded < self.inactive and self.steepness > 0):
            found = (self.impenetrable, self.inactive, self.steepness)
            expected = f"0 < {1 + GUARD:g} rho < nu, and a steepness above 0"
            raise InvalidSetting("safety.rho, nu, steepness", found, expected)

    @property
    def guarded(self) -> float:
        """The distance at which a motion stops, a little more than ρ."""
        return (1 + GUARD) * self.impenetrable

    def below(self, passage: float) -> "Levels":
        """With ν lowered to the S of a passage, which a motion can then pass.

        Before a bottleneck, n points back from it, and up to the middle of the sigmoid next to no motion against n is
        left, however far above ρ the bottleneck is; getting through would take many times the duration of the skill.
        """
        return replace(self, inactive=min(self.inactive, max(passage, NARROWEST * self.guarded)))

    def switched(self, distance: Tensor, initial: float, end: float) -> Tensor:
        r"""Ξ: `initial` up to ρ, `end` from ν on, and a sigmoid between them.

        The sigmoid as printed is 1e-4 at ρ, where a motion would pass slowly. Here it is stretched such that it is
        exactly `initial` up to ρ, or a hundredth of ρ before it, and `end` from ν on.

        Source:
            Thesis Eq. (6.6), (6.7).
        """
        half = self.steepness * (self.inactive - self.guarded) / 2
        middle = (self.guarded + self.inactive) / 2
        share = (torch.tanh(self.steepness / 2 * (distance - middle)) / math.tanh(half / 2) + 1) / 2
        return initial + (end - initial) * torch.where(distance > self.guarded, share.clamp(0, 1), 0.0)


@dataclass(frozen=True)
class Reason:
    """One reason to stay away from a part of the latent plane.

    Attributes:
        name: What to call it.
        volume: 𝒱 at the nodes, at least zero.
        scale: α.
    """

    name: str
    volume: NodeValues
    scale: float

    @property
    def closeness(self) -> NodeValues:
        """1/S of this reason alone."""
        return self.volume / self.scale


def calibrated(name: str, volume: NodeValues, is_unsafe: Bool[np.ndarray, " node"], levels: Levels) -> Reason:
    """The largest α such that S ≤ ρ at every unsafe node; the thesis chooses it by hand.

    What is guaranteed is one-sided. That S > ν everywhere else, as the thesis asks, cannot be had with any α: between
    ρ and ν there is the width over which the volume falls by ν/ρ.

    Raises:
        MissingData: If no node is unsafe: the obstacle is outside of what the manifold reaches, or between nodes.
        InvalidSetting: If the volume vanishes at an unsafe node, and with it any α.
    """
    if not is_unsafe.any():
        raise MissingData(f"a latent node in {name}", "It does not stand in the way; leave it out, or refine the grid.")
    least = float(volume[is_unsafe].min())
    if not least > 0:
        raise InvalidSetting(
            "safety.points_per_axis",
            "too few",
            f"more: {name} is not felt at all nodes that have to be kept away from it, so small is it beside an edge",
        )
    return Reason(name, volume, levels.impenetrable * least)


def distance_on_grid(reasons: Sequence[Reason]) -> NodeValues:
    """S at the nodes."""
    closeness = np.stack([one.closeness for one in reasons])
    largest = closeness.max(axis=0)
    return np.asarray(1 / (largest * ((closeness / largest) ** SHARPNESS).sum(axis=0) ** (1 / SHARPNESS)))


def narrowest_passage(grid: LatentGrid, distance: NodeValues, starts: Int[np.ndarray, " start"], goal: int) -> float:
    """The largest S that a way to the goal can keep from every start: the S of its bottleneck.

    Args:
        grid: Of the nodes.
        distance: S at them.
        starts: Numbers of nodes from which there is a way at all.
        goal: Another one.
    """
    ends, lowest = grid.edges, distance[grid.edges].min(axis=1)
    wanted = np.append(starts, goal)

    def has_none(level: float) -> bool:
        open_ends = ends[lowest >= level]
        linked = csr_array((np.ones(len(open_ends)), open_ends.T), shape=(len(distance),) * 2)
        return bool(np.ptp(connected_components(linked, directed=False)[1][wanted]) > 0)

    levels = np.sort(distance[distance <= distance[wanted].min()])
    return float(levels[bisect_left(levels, True, lo=1, key=has_none) - 1])


@dataclass(frozen=True)
class Sight:
    """What points see of the region's border.

    Attributes:
        distance: S.
        freedom: λ_n, zero where a motion stops and one from ν on; λ_τ is 2 - λ_n.
        normal: n = ∇S/‖∇S‖, away from what is unsafe.
        outside: Zero where S ≥ ρ, one from `CLEARLY_OUT` below it on.
        depth: How far it is to where a motion stops from a point beyond that; otherwise zero.
        inward: The direction of that way.
        onward: Direction in which the way to the goal shrinks fastest; zero where there is none.
    """

    distance: Values
    freedom: Values
    normal: Points
    outside: Values
    depth: Values
    inward: Points
    onward: Points


class SafetyRegion(nn.Module):
    """{z : S(z) > ρ}, and the way to the goal in it.

    Args:
        grid: Planar; its border unsafe.
        distance: S at its nodes.
        way_to_goal: Length of the shortest way to the goal from each node; infinite where there is none.
        levels: ρ, ν and k.

    Raises:
        InvalidSetting: If a node on the grid's border is safe.
    """

    steps_out: Tensor

    def __init__(self, grid: LatentGrid, distance: NodeValues, way_to_goal: NodeValues, levels: Levels) -> None:
        super().__init__()
        border = np.ones(grid.shape, dtype=bool)
        border[1:-1, 1:-1] = False
        if (distance.reshape(grid.shape)[border] > levels.impenetrable).any():
            expected = "less, so that what is safe ends before the border of the latent grid does"
            raise InvalidSetting("safety.nu", levels.inactive, expected)
        self.levels = levels
        columns = [-np.log(distance), _everywhere(grid, way_to_goal), _cells_out(grid, way_to_goal)]
        self.maps = GridSpline(grid, np.stack(columns, axis=1))
        self.register_buffer("steps_out", torch.tensor([1.0, 0.0, 1.0], dtype=torch.float64))

    def distance(self, points: Points) -> Float[Tensor, "*batch"]:
        """S."""
        return (-self._seen(points)[0][..., 0]).exp()

    def is_safe(self, points: Points) -> Bool[Tensor, "*batch"]:
        """Whether S > ρ."""
        return self.distance(points) > self.levels.impenetrable

    def sight(self, points: Points) -> Sight:
        """What points see of the border.

        At the border, the way in is along ∇S. Farther out, or deep in an obstacle, S is flat or has maxima of its own;
        the way is then to the nearest node from which the goal can be reached.
        """
        values, slopes = self._seen(points)
        closeness, cells = values[..., :1], values[..., 2:].clamp(min=0)
        distance = (-closeness).exp()
        steepness = slopes[..., 0, :].norm(dim=-1, keepdim=True).clamp(min=DIRECTION_FLOOR)
        normal = -slopes[..., 0, :] / steepness
        by_slope = (closeness + math.log(self.levels.guarded)).clamp(min=0) / steepness
        to_node = -self.maps.cell.square() * slopes[..., 2, :]
        outside = ((closeness + math.log(self.levels.impenetrable)) / math.log(CLEARLY_OUT)).clamp(0, 1)
        return Sight(
            distance,
            self.levels.switched(distance, 0.0, 1.0),
            normal,
            outside,
            torch.minimum(by_slope, (cells + 1) * self.maps.cell.norm()),
            (1 - outside) * normal + outside * _unit(to_node),
            -_unit(slopes[..., 1, :]),
        )

    def _seen(self, points: Points) -> tuple[Float[Tensor, "*batch 3"], Float[Tensor, "*batch 3 2"]]:
        """log 1/S, the way to the goal, and cells to the nearest node that has one, also outside of the grid."""
        values, gradients = self.maps(points)
        beyond = (points - self.maps.nearest(points)) / self.maps.cell
        outward = beyond.norm(dim=-1, keepdim=True) * self.steps_out, _unit(beyond)[..., None, :] / self.maps.cell
        return values + outward[0], gradients + self.steps_out[:, None] * outward[1]


def _unit(vectors: Points) -> Points:
    units: Tensor = vectors / vectors.norm(dim=-1, keepdim=True).clamp(min=DIRECTION_FLOOR)
    return units


def _everywhere(grid: LatentGrid, way: NodeValues) -> NodeValues:
    """Ways to the goal, smoothed over a cell, and from nodes without one: to the nearest node that has one and on."""
    is_open = np.isfinite(way).reshape(grid.shape)
    cells, nearest = distance_transform_edt(~is_open, return_indices=True)
    known = way.reshape(grid.shape)[tuple(nearest)]
    per_cell = known[is_open].max() / max(grid.shape)
    return np.asarray(gaussian_filter(known + per_cell * cells, sigma=1.0, mode="nearest").ravel())


def _cells_out(grid: LatentGrid, way: NodeValues) -> NodeValues:
    """How many cells away the nearest node with a way to the goal is, smoothed over a cell."""
    cells = distance_transform_edt(~np.isfinite(way).reshape(grid.shape))
    return np.asarray(gaussian_filter(cells, sigma=1.0, mode="nearest").ravel())
