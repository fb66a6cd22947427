"""Obstacles that are grown for a point that stands for a larger body."""

import numpy as np
import pytest
import torch
import trimesh

from geomotion import config as schema
from geomotion.stages.scene import around_obstacles, build_obstacle, grown

BY_M = 0.05


class Straight(torch.nn.Module):
    """Along the first axis."""

    dim = 3

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return torch.tensor([1.0, 0.0, 0.0]).expand_as(x)


ORIGIN = [0.1, 0.0, -0.2]
BODIES = {
    "sphere": schema.SphereObstacle(centre_m=ORIGIN, radius_m=0.1),
    "box": schema.BoxObstacle(centre_m=ORIGIN, sides_m=[0.1, 0.2, 0.3]),
    "ellipsoid": schema.EllipsoidObstacle(centre_m=ORIGIN, semi_axes_m=[0.05, 0.1, 0.2]),
}


@pytest.mark.parametrize("kind", BODIES)
def test_what_is_near_an_obstacle_is_inside_the_grown_one(kind):
    points = 0.8 * torch.rand(5000, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64) - 0.4
    plain, larger = (build_obstacle(one, points[0]) for one in (BODIES[kind], grown(BODIES[kind], BY_M)))
    near = plain.signed_distance(points) < BY_M - 1e-9
    assert near.sum() > 100
    assert (larger.signed_distance(points[near]) <= 1e-9).all()


def test_several_are_grown_each_and_free_space_stays_free():
    several = schema.SeveralObstacles(bodies=[BODIES["sphere"], BODIES["box"]])
    assert [body.sides_m if hasattr(body, "sides_m") else body.radius_m for body in grown(several, BY_M).bodies] == [
        pytest.approx(0.15),
        pytest.approx([0.2, 0.3, 0.4]),
    ]
    assert grown(schema.NoObstacle(), BY_M) == schema.NoObstacle()


def test_a_mesh_that_is_not_convex_is_kept_clear_of_too(tmp_path):
    """A ball with dents: what the field goes around is as far away as is asked for, at least."""
    ball = trimesh.creation.icosphere(subdivisions=1)
    ball.vertices *= 0.1 + 0.04 * np.cos(3 * ball.vertices[:, :1]) * np.cos(2 * ball.vertices[:, 1:2])
    ball.export(tmp_path / "dented.stl")
    config = schema.MeshObstacle(centre_m=[0.3, 0.0, 0.0], file=str(tmp_path / "dented.stl"))
    goal = torch.tensor([2.0, 0.0, 0.0])
    field = around_obstacles(grown(config, BY_M), Straight(), goal, 3)
    surface = torch.from_numpy(np.asarray(ball.sample(500, seed=0))).float() + torch.tensor([0.3, 0.0, 0.0])
    directions = torch.nn.functional.normalize(torch.randn(500, 3, generator=torch.Generator().manual_seed(0)), dim=-1)
    assert (field.obstacles[0].level(surface + BY_M * directions) < 1).all()
