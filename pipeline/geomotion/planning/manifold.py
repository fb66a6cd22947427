"""What planning asks of a learned manifold, and its decoded grid."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from geomotion.manifolds.grid import LatentGrid
from geomotion.scores.paths import PosePath
from geomotion.scores.pose_support import PoseSupport
from geomotion.types import Tensor

Codes = Float[np.ndarray, "point d"]
NODES_AT_ONCE = 200  # decoded in one batch: against thousands of kernels, larger ones do not fit into the caches


@dataclass(frozen=True)
class DecodedPath:
    """Poses with their progress.

    Attributes:
        poses: Mean poses.
        progress: Share of the demonstrated motion that is done there, about 0 to 1.
    """

    poses: PosePath
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
        """Mean poses at latent points."""
        ...

    def embed(self, z: Codes) -> tuple[Float[np.ndarray, "point P"], Float[np.ndarray, "point Q"]]:
        """Coordinates whose Euclidean metric is pulled back: those of positions, and the others."""
        ...

    def stretch(self, z: Codes) -> Float[np.ndarray, " point"]:
        """Conformal factor f."""
        ...

    def embedding(self, z: Tensor) -> Tensor:
        """Both embedded blocks side by side, differentiable, shape (point, m)."""
        ...

    def conformal(self, z: Tensor) -> Tensor:
        """Conformal factor, differentiable, shape (point,)."""
        ...


@dataclass(frozen=True)
class Surface:
    """A latent grid with everything that its nodes decode to; kept in memory while a robot moves (Fig. 3.4).

    Attributes:
        grid: The nodes.
        decoded: Their poses.
        position: Embedded positions.
        rest: Embedded orientations.
        stretch: Conformal factors.
        apart_m: How far their positions are from the demonstrations [m].
        apart_rad: How far their orientations are from those demonstrated nearby [rad].
    """

    grid: LatentGrid
    decoded: DecodedPath
    position: Float[np.ndarray, "node P"]
    rest: Float[np.ndarray, "node Q"]
    stretch: Float[np.ndarray, " node"]
    apart_m: Float[np.ndarray, " node"]
    apart_rad: Float[np.ndarray, " node"]

    @classmethod
    def of(cls, manifold: SkillManifold, grid: LatentGrid, support: PoseSupport) -> "Surface":
        """Decode a grid.

        Args:
            manifold: Decoder.
            grid: Latent nodes.
            support: The poses that the manifold was fitted to.
        """
        columns: list[np.ndarray] = []  # made once: results kept between batches would leave holes in memory
        for begin in range(0, len(grid.nodes), NODES_AT_ONCE):
            batch = _of_batch(manifold, grid.nodes[begin : begin + NODES_AT_ONCE], support)
            columns = columns or [np.empty((len(grid.nodes), *part.shape[1:])) for part in batch]
            for column, part in zip(columns, batch, strict=True):
                column[begin : begin + len(part)] = part
        position_m, orientation, progress, *others = columns
        return cls(grid, DecodedPath(PosePath(position_m, orientation), progress), *others)

    @cached_property
    def columns(self) -> Float[np.ndarray, "node column"]:
        """Embedded positions, embedded orientations and conformal factors side by side."""
        return np.column_stack([self.position, self.rest, self.stretch])

    def within(self, cap_m: float, cap_rad: float) -> np.ndarray:
        """Which nodes are no farther from the demonstrations than a cap, shape (node,)."""
        return np.asarray((self.apart_m <= cap_m) & (self.apart_rad <= cap_rad))


def _of_batch(manifold: SkillManifold, nodes: Codes, support: PoseSupport) -> tuple[np.ndarray, ...]:
    decoded = manifold.decode(nodes)
    poses = decoded.poses
    apart = support.distances(poses.position_m, poses.orientation)
    return (
        poses.position_m,
        poses.orientation,
        decoded.progress,
        *manifold.embed(nodes),
        manifold.stretch(nodes),
        *apart,
    )
