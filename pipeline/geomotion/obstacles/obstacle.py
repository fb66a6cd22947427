"""What an obstacle is, and what can be said of every one."""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import torch

from geomotion.obstacles.body import Body
from geomotion.types import Float, State, Tensor, Times

OVERLAP_SAMPLES = 1000
BISECTIONS = 60  # halves an interval until neighbouring double-precision numbers


@runtime_checkable
class Obstacle(Body, Protocol):
    """A solid body that every ray from its reference point leaves exactly once (star-shaped).

    Its signed distance is differentiable outside.
    """

    def level(self, x: State) -> Float[Tensor, "*batch"]:
        """Γ(x): one at the surface, growing along every ray from the reference point, C¹ outside.

        Source: Huber et al. (2022); Thesis Sec. 5.4.
        """
        ...

    def normal(self, x: State) -> State:
        """∇Γ/‖∇Γ‖, the unit normal of the level set of Γ through x, pointing away from the obstacle."""
        ...


def surface_points(obstacle: Obstacle, directions: Float[Tensor, "*batch D"]) -> Float[Tensor, "*batch D"]:
    """Where rays from the reference point leave the obstacle.

    Args:
        obstacle: Star-shaped about its reference point, at time zero.
        directions: Unit vectors.
    """
    low = torch.full_like(directions[..., :1], obstacle.inradius)
    high = 2 * low
    while bool((obstacle.level(obstacle.reference + high * directions) < 1).any()):
        high = 2 * high
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        is_inside = (obstacle.level(obstacle.reference + middle * directions) < 1)[..., None]
        low, high = torch.where(is_inside, middle, low), torch.where(is_inside, high, middle)
    return obstacle.reference + high * directions


def overlap(first: Obstacle, second: Obstacle) -> bool:
    """Whether points of a body, on its surface or its reference point, lie in another one, both at time zero.

    The surface is sampled, so that a thin tip may be missed; the other way round it is not missed.
    """
    dim = first.dim
    directions = torch.randn(OVERLAP_SAMPLES, dim, generator=torch.Generator().manual_seed(0)).to(first.reference)
    surface = surface_points(first, directions / directions.norm(dim=-1, keepdim=True))
    points = torch.cat([surface, first.reference[None]])
    return bool((second.level(points) < 1).any())


def clearance(
    obstacles: Sequence[Body], states: Float[Tensor, "*batch time D"], times: Times
) -> Float[Tensor, "*batch"]:
    """Smallest signed distance between a trajectory and the obstacles, which move meanwhile [m].

    Args:
        obstacles: One or more.
        states: Trajectories.
        times: Times since the obstacles were where their reference points say [s].
    """
    shifted = (states - times[:, None] * obstacle.velocity for obstacle in obstacles)
    distances = [obstacle.signed_distance(x) for obstacle, x in zip(obstacles, shifted, strict=True)]
    return torch.stack(distances).amin(dim=0).amin(dim=-1)
