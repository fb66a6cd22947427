"""What there is to see of a safety region, computed."""

import numpy as np
import torch

from geomotion.dynamics.fields import VectorField
from geomotion.dynamics.rollout import rollout
from geomotion.figures.safety import SafetyPicture
from geomotion.obstacles.safe_field import PLANE, Onward, against_geodesic, follow_safely
from geomotion.obstacles.safety_region import distance_on_grid
from geomotion.safe_skills import SafeSkill
from geomotion.types import Float

STEPS, DURATIONS = 300, 3.0  # of the rollouts
CURVE_POINTS = 300  # of λ_n and λ_τ
BEYOND = 1.2  # times ν, up to which these are drawn


def safety_picture(safe: SafeSkill, starts: Float[np.ndarray, "start 2"]) -> SafetyPicture:
    """Fields and rollouts from latent starts, with the region and without."""
    grid, levels = safe.nodes.grid, safe.region.levels
    field, free = safe.safe_field(), safe.free_field()
    states = torch.from_numpy(np.pad(starts, ((0, 0), (0, field.dim - PLANE))))
    times = torch.linspace(0, DURATIONS, STEPS + 1).double()

    def followed(onward: Onward | None) -> Float[np.ndarray, "start time 2"]:
        return np.asarray(follow_safely(safe.safe_field(onward), states, times)[0][..., :PLANE].numpy())

    curve = torch.linspace(0, BEYOND * levels.inactive, CURVE_POINTS).double()
    return SafetyPicture(
        axes=np.linspace(grid.low, grid.high, grid.points_per_axis).T,
        volume=safe.volume.reshape(grid.shape),
        distance=distance_on_grid(safe.reasons).reshape(grid.shape),
        levels=np.array([levels.impenetrable, levels.inactive, levels.steepness]),
        is_inside=(safe.node_clearance_m < 0).reshape(grid.shape),
        switching=torch.stack([curve, levels.switched(curve, 0.0, 1.0), levels.switched(curve, 2.0, 1.0)]).numpy(),
        codes=safe.surface.codes,
        geodesic=safe.geodesic(safe.surface.codes[0][0]),
        goal=safe.goal[0],
        free=rollout(free, states, times).states[..., :PLANE].numpy(),
        safe=followed(field.onward),
        unhelped=followed(None),
        misled=followed(against_geodesic),
        free_flow=_flow(safe, free),
        safe_flow=_flow(safe, field),
    )


@torch.no_grad()
def _flow(safe: SafeSkill, field: VectorField) -> Float[np.ndarray, "n n 2"]:
    """Velocities at the safe nodes; nothing elsewhere."""
    grid = safe.nodes.grid
    nodes = torch.from_numpy(np.pad(grid.nodes, ((0, 0), (0, field.dim - PLANE))))
    velocity = field(nodes)[:, :PLANE]
    is_safe = safe.region.is_safe(nodes[:, :PLANE])
    return np.asarray(torch.where(is_safe[:, None], velocity, torch.nan).numpy().reshape(*grid.shape, PLANE))
