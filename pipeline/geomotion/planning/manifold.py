"""What planning asks of a learned manifold, and its decoded grid."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float

from geomotion.manifolds.grid import LatentGrid
from geomotion.scores.paths import MotionPath
from geomotion.scores.pose_support import Support
from geomotion.types import Tensor

Codes = Float[np.ndarray, "point d"]
NODES_AT_ONCE = 200  # decoded in one batch: against thousands of kernels, larger ones do not fit into the caches


@dataclass(frozen=True)
class DecodedPath:
    """States with their progress.

    Attributes:
        states: Mean poses, or mean configurations.
        progress: Share of the demonstrated motion that is done there, about 0 to 1.
    """

    states: MotionPath
    progress: Float[np.ndarray, " point"]


@runtime_checkable
class SkillManifold(Protocol):
    """A trained manifold, as arrays in double precision.

    Attributes:
        latent_dim: d.
        scale_m: Length that counts as much as one unit of an orientation [m].
    """

    latent_dim: int
    scale_m: float

    def decode(self, z: Codes) -> DecodedPath:
        """Mean states at latent points."""
        ...

    def embed(self, z: Codes) -> tuple[Float[np.ndarray, "point B P"], Float[np.ndarray, "point Q"]]:
        """Coordinates whose Euclidean metric is pulled back: those of each point that obstacles act on, and others."""
        ...

    def stretch(self, z: Codes) -> Float[np.ndarray, " point"]:
        """Conformal factor f."""
        ...

    def embedding(self, z: Tensor) -> Tensor:
        """All embedded coordinates side by side, differentiable, shape (point, m)."""
        ...

    def conformal(self, z: Tensor) -> Tensor:
        """Conformal factor, differentiable, shape (point,)."""
        ...

    def allows(self, states: MotionPath) -> Bool[np.ndarray, " state"]:
        """Whether the robot can be in states at all: within the limits of its joints, where these are known."""
        ...

    def separation(self, states: MotionPath, one: MotionPath) -> Float[np.ndarray, " state"]:
        """Distances of states to one, in units of the manifold's scale."""
        ...


@dataclass(frozen=True)
class Surface:
    """A latent grid with everything that its nodes decode to; kept in memory while a robot moves (Fig. 3.4).

    Attributes:
        grid: The nodes.
        decoded: Their states.
        position: Embedded positions, one block for each point that obstacles act on.
        rest: Other embedded coordinates.
        stretch: Conformal factors.
        apart_m: How far their end effector is from the demonstrations [m].
        apart_rad: How far their angles are from those demonstrated nearby [rad].
    """

    grid: LatentGrid
    decoded: DecodedPath
    position: Float[np.ndarray, "node B P"]
    rest: Float[np.ndarray, "node Q"]
    stretch: Float[np.ndarray, " node"]
    apart_m: Float[np.ndarray, " node"]
    apart_rad: Float[np.ndarray, " node"]

    @classmethod
    def of(cls, manifold: SkillManifold, grid: LatentGrid, support: Support) -> "Surface":
        """Decode a grid.

        Args:
            manifold: Decoder.
            grid: Latent nodes.
            support: The states that the manifold was fitted to.
        """
        columns: list[np.ndarray] = []  # made once: results kept between batches would leave holes in memory
        for begin in range(0, len(grid.nodes), NODES_AT_ONCE):
            batch = _of_batch(manifold, grid.nodes[begin : begin + NODES_AT_ONCE], support)
            columns = columns or [np.empty((len(grid.nodes), *part.shape[1:])) for part in batch]
            for column, part in zip(columns, batch, strict=True):
                column[begin : begin + len(part)] = part
        vectors, progress, *others = columns
        like = manifold.decode(grid.nodes[:1]).states
        return cls(grid, DecodedPath(like.with_vectors(vectors), progress), *others)

    @cached_property
    def columns(self) -> Float[np.ndarray, "node column"]:
        """Embedded positions, other embedded coordinates and conformal factors side by side."""
        return np.column_stack([self.position.reshape(len(self.stretch), -1), self.rest, self.stretch])

    def within(self, cap_m: float, cap_rad: float) -> np.ndarray:
        """Which nodes are no farther from the demonstrations than a cap, shape (node,)."""
        return np.asarray((self.apart_m <= cap_m) & (self.apart_rad <= cap_rad))


def _of_batch(manifold: SkillManifold, nodes: Codes, support: Support) -> tuple[np.ndarray, ...]:
    decoded = manifold.decode(nodes)
    return (
        decoded.states.vectors,
        decoded.progress,
        *manifold.embed(nodes),
        manifold.stretch(nodes),
        *support.distances(decoded.states),
    )
