"""Poses as states of a manifold."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float

from geomotion.scores.paths import MotionPath, PosePath
from geomotion.scores.pose_support import PoseSupport
from geomotion.training.states import Scaled
from geomotion.types import Tensor


@dataclass(frozen=True)
class PoseSpace:
    """Place and size of demonstrated poses; a :class:`geomotion.training.states.StateSpace`.

    Attributes:
        orientation_dim: 4 for quaternions, 3 for directions.
        centre_m: Mean position.
        scale_m: Root mean square distance to it: one scale for all axes.
    """

    orientation_dim: int
    centre_m: tuple[float, ...]
    scale_m: float

    @classmethod
    def of(cls, paths: Sequence[PosePath]) -> "PoseSpace":
        """Measure demonstrations."""
        positions = np.concatenate([path.position_m for path in paths])
        centre = positions.mean(axis=0)
        scale = float(np.sqrt(np.square(positions - centre).sum(axis=1).mean()))
        return cls(paths[0].orientation.shape[1], tuple(centre.tolist()), scale)

    @property
    def position_dim(self) -> int:
        """Dx."""
        return len(self.centre_m)

    def scaled(self, path: MotionPath) -> Scaled:
        """Poses as the network sees them."""
        return np.concatenate([(path.position_m - self.centre_m) / self.scale_m, path.orientation], axis=1)

    def path(self, scaled: Scaled) -> PosePath:
        """The poses that a network means; their orientations are unit vectors."""
        dim = self.position_dim
        return PosePath(scaled[:, :dim] * self.scale_m + self.centre_m, scaled[:, dim:])

    def separation(self, states: MotionPath, one: MotionPath) -> Float[np.ndarray, " pose"]:
        """Distances of poses to one, whatever the sign of its orientation, in units of the scale."""
        across = (states.position_m - one.position_m) / self.scale_m
        cosine = np.abs(states.orientation @ one.orientation[0])
        return np.asarray(np.sqrt(np.square(across).sum(axis=1) + 2 * (1 - cosine.clip(max=1))))

    def allows(self, states: MotionPath) -> Bool[np.ndarray, " pose"]:
        """All: what an arm can reach is not known here."""
        return np.ones(len(states), dtype=bool)

    def support(self, demonstrations: Sequence[MotionPath]) -> PoseSupport:
        """Demonstrated poses, ready for queries."""
        return PoseSupport.of(demonstrations)

    def document(self) -> dict[str, Any]:
        """As JSON types."""
        return asdict(self)


def both_signs(poses: Tensor, progress: Tensor, position_dim: int) -> tuple[Tensor, Tensor]:
    """Every pose a second time with -q; shapes (2 point, D) and (2 point,)."""
    other = torch.cat([poses[:, :position_dim], -poses[:, position_dim:]], dim=1)
    return torch.cat([poses, other]), torch.cat([progress, progress])
