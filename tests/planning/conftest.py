"""A manifold with known geometry: a bent strip in space, along which the hand turns."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from geomotion.manifolds.grid import LatentGrid
from geomotion.planning.ends import Anchors
from geomotion.planning.manifold import DecodedPath, SkillManifold, Surface
from geomotion.planning.planner import Planner, PlannerSettings
from geomotion.scores.paths import PosePath
from geomotion.scores.pose_support import PoseSupport

RADIUS_M, HALF_WIDTH_M, SCALE_M = 0.5, 0.1, 0.5
SETTINGS = PlannerSettings(cap_m=0.03, cap_rad=0.3, end_cap_m=0.06, end_cap_rad=0.6)


class Strip:
    """Latent (s, c): share of half a circle, and distance beside it [m]; outside of the strip the spread rises."""

    latent_dim, scale_m = 2, SCALE_M

    def blocks(self, z: Tensor) -> tuple[Tensor, Tensor]:
        s, c = z.unbind(dim=-1)
        angle, around = np.pi * s, RADIUS_M + c
        position = torch.stack([around * angle.cos(), around * angle.sin(), 0.1 * s], dim=-1)
        nothing = torch.zeros_like(s)
        quaternion = torch.stack([(angle / 2).cos(), nothing, nothing, (angle / 2).sin()], dim=-1)
        outside = (c.abs() - HALF_WIDTH_M).clamp(min=0) / HALF_WIDTH_M
        return position[..., None, :] / SCALE_M, torch.cat([quaternion, 50 * outside[..., None]], dim=-1)

    def decode(self, z: np.ndarray) -> DecodedPath:
        position, rest = self.embed(z)
        return DecodedPath(PosePath(position[:, 0] * SCALE_M, rest[:, :4]), z[:, 0])

    def embed(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        position, rest = self.blocks(torch.from_numpy(z))
        return position.numpy(), rest.numpy()

    def stretch(self, z: np.ndarray) -> np.ndarray:
        return self.conformal(torch.from_numpy(z)).numpy()

    def embedding(self, z: Tensor) -> Tensor:
        position, rest = self.blocks(z)
        return torch.cat([position.flatten(-2), rest], dim=-1)

    def conformal(self, z: Tensor) -> Tensor:
        return 1 + (z[..., 1] / HALF_WIDTH_M).square()

    def allows(self, states: PosePath) -> np.ndarray:
        return np.ones(len(states), dtype=bool)

    def separation(self, states: PosePath, one: PosePath) -> np.ndarray:
        across = np.linalg.norm(states.position_m - one.position_m, axis=1) / SCALE_M
        cosine = np.abs(states.orientation @ one.orientation[0]).clip(max=1)
        return np.sqrt(across**2 + 2 * (1 - cosine))


def pose(s: float, c: float = 0.0) -> PosePath:
    """One pose on the strip."""
    return Strip().decode(np.array([[s, c]])).states


def demonstrations(without: tuple[float, float] = (2.0, 2.0)) -> list[PosePath]:
    """Five poses abreast, along the strip, but for a part of it."""
    shares = np.linspace(0, 1, 120)
    shares = shares[(shares < without[0]) | (shares > without[1])]
    across = np.linspace(-HALF_WIDTH_M, HALF_WIDTH_M, 5)
    return [Strip().decode(np.column_stack([shares, np.full(len(shares), c)])).states for c in across]


def make_planner(points_per_axis: int = 51, without: tuple[float, float] = (2.0, 2.0), **changes) -> Planner:
    """A planner on the strip; `changes` of the settings."""
    manifold = Strip()
    assert isinstance(manifold, SkillManifold)
    grid = LatentGrid(np.array([-0.04, -0.15]), np.array([1.04, 0.15]), points_per_axis)
    support = PoseSupport.of(demonstrations(without))
    surface = Surface.of(manifold, grid, support)
    ends = [Anchors(np.array([[s, 0.0]]), pose(s), np.array([0.03 / SCALE_M])) for s in (0.0, 1.0)]
    return Planner(manifold, surface, support, *ends, replace(SETTINGS, **changes))


@pytest.fixture
def planner() -> Callable[..., Planner]:
    return make_planner


@pytest.fixture
def pose_on_strip() -> Callable[..., PosePath]:
    return pose
