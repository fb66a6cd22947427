"""Regular grids over latent space and their neighbours."""

import itertools
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from geomotion.errors import InvalidSetting, TooLargeForMemory

BYTES_PER_EDGE = 120  # squared chord, stretch, weights, ends, two stored directions with their numbers
BYTES_PER_NODE = 400  # decoded state, support, incidence
BYTES_PER_BLOCK = 8, 40  # of an edge: squared chord; of a node: embedded position and factor


@dataclass(frozen=True)
class LatentGrid:
    """A box of latent space cut into equal cells.

    Attributes:
        low: Lower corner.
        high: Upper corner.
        points_per_axis: Nodes along each axis.
    """

    low: Float[np.ndarray, " d"]
    high: Float[np.ndarray, " d"]
    points_per_axis: int

    @classmethod
    def around(cls, points: Float[np.ndarray, "point d"], points_per_axis: int, margin: float) -> "LatentGrid":
        """The bounding box of latent points, widened on each side by a share of its extent."""
        low, high = points.min(axis=0).astype(float), points.max(axis=0).astype(float)
        room = margin * (high - low)
        return cls(low - room, high + room, points_per_axis)

    @property
    def dim(self) -> int:
        """d."""
        return len(self.low)

    @property
    def shape(self) -> tuple[int, ...]:
        """Nodes along each axis."""
        return (self.points_per_axis,) * self.dim

    @property
    def cell(self) -> Float[np.ndarray, " d"]:
        """Distance between neighbouring nodes along each axis."""
        return np.asarray((self.high - self.low) / (self.points_per_axis - 1))

    @cached_property
    def nodes(self) -> Float[np.ndarray, "node d"]:
        """All nodes, the last axis fastest."""
        axes = [np.linspace(*ends, self.points_per_axis) for ends in zip(self.low, self.high, strict=True)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, self.dim)

    @cached_property
    def edges(self) -> Int[np.ndarray, "edge 2"]:
        """Pairs of neighbouring nodes, diagonals included (8 neighbours in the plane, 26 in space), each pair once."""
        numbers = np.arange(math.prod(self.shape)).reshape(self.shape)
        pairs = []
        for step in self.steps:
            ends = self._shifted(numbers, step, 1), self._shifted(numbers, step, -1)
            pairs.append(np.stack([end.ravel() for end in ends], axis=1))
        return np.concatenate(pairs)

    @cached_property
    def steps(self) -> tuple[tuple[int, ...], ...]:
        """From a node to half of its neighbours, in nodes along each axis; the others are opposite."""
        return tuple(step for step in itertools.product((-1, 0, 1), repeat=self.dim) if step > (0,) * self.dim)

    def _shifted(
        self, numbers: Int[np.ndarray, "*shape"], step: tuple[int, ...], side: int
    ) -> Int[np.ndarray, "*part"]:
        count = self.points_per_axis
        cuts = (slice(max(0, -side * one), count - max(0, side * one)) for one in step)
        return numbers[tuple(cuts)]

    def contains(self, points: Float[np.ndarray, "point d"]) -> Bool[np.ndarray, " point"]:
        """Whether points lie in the box."""
        return np.asarray(((points >= self.low) & (points <= self.high)).all(axis=1))

    def nearest(self, points: Float[np.ndarray, "point d"]) -> Int[np.ndarray, " point"]:
        """Numbers of the nodes nearest to latent points; points outside count as on the border."""
        steps = np.clip(np.rint((points - self.low) / self.cell), 0, self.points_per_axis - 1).astype(int)
        return np.asarray(np.ravel_multi_index(tuple(steps.T), self.shape))

    def interpolate(
        self, values: Float[np.ndarray, "node k"], points: Float[np.ndarray, "point d"]
    ) -> Float[np.ndarray, "point k"]:
        """Multilinear interpolation of values at nodes; points outside count as on the border."""
        numbers, shares = self.corners(points)
        return np.asarray(np.einsum("pc,pck->pk", shares, values[numbers]))

    def corners(
        self, points: Float[np.ndarray, "point d"]
    ) -> tuple[Int[np.ndarray, "point corner"], Float[np.ndarray, "point corner"]]:
        """Nodes around points, and their shares in a multilinear interpolation there."""
        place = np.clip((points - self.low) / self.cell, 0, self.points_per_axis - 1)
        lowest = np.minimum(place.astype(int), self.points_per_axis - 2)
        beyond = place - lowest
        numbers, shares = np.zeros((len(points), 1), dtype=int), np.ones((len(points), 1))
        for axis in range(self.dim):
            ahead = lowest[:, axis, None, None] + np.arange(2)
            split = np.stack([1 - beyond[:, axis], beyond[:, axis]], axis=1)[:, None]
            numbers = (numbers[:, :, None] * self.points_per_axis + ahead).reshape(len(points), -1)
            shares = (shares[:, :, None] * split).reshape(len(points), -1)
        return numbers, shares


def memory_bytes(points_per_axis: int, dim: int, blocks: int = 1) -> int:
    """What a graph on such a grid takes, estimated from above without allocating it.

    Args:
        points_per_axis: Nodes along each axis.
        dim: Number of axes.
        blocks: Points that obstacles act on.
    """
    edges = (3**dim - 1) // 2
    per_edge, per_node = BYTES_PER_EDGE + blocks * BYTES_PER_BLOCK[0], BYTES_PER_NODE + blocks * BYTES_PER_BLOCK[1]
    return int(points_per_axis**dim * (per_node + per_edge * edges))


def require_memory(points_per_axis: int, dim: int, limit_bytes: int, blocks: int = 1) -> None:
    """Check that a grid fits before it is made; the arguments are those of :func:`memory_bytes`.

    Raises:
        InvalidSetting: If an axis has fewer than two points.
        TooLargeForMemory: If the graph would need more than `limit_bytes`; says how much, and what would fit.
    """
    if points_per_axis < 2:
        raise InvalidSetting("graph.points_per_axis", points_per_axis, "2 or more")
    needed = memory_bytes(points_per_axis, dim, blocks)
    if needed > limit_bytes:
        fitting = int((limit_bytes / memory_bytes(1, dim, blocks)) ** (1 / dim))
        raise TooLargeForMemory(
            f"a latent grid of {points_per_axis}^{dim} nodes", needed, limit_bytes, f"graph.points_per_axis={fitting}"
        )
