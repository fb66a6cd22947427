"""Obstacles that are grown for a point that stands for a larger body."""

import pytest
import torch

from geomotion import config as schema
from geomotion.stages.scene import build_obstacle, grown

BY_M = 0.05
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
