"""Safety regions of skills: which nodes they leave, and that they do not depend on latent coordinates."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from geomotion import config as schema
from geomotion import models
from geomotion.errors import InvalidSetting, MissingData
from geomotion.models import ModelConfig, Skill
from geomotion.obstacles.motion import ConstantVelocity, MovingBody
from geomotion.obstacles.safety_region import distance_on_grid
from geomotion.obstacles.solids import Sphere
from geomotion.safe_skills import SafeSkill, safe_skill
from geomotion.training.data import Geometry

SETTINGS = schema.RiemannianSafety(points_per_axis=50)
DEMONSTRATED = [np.outer(1 - np.linspace(0, 1, 60), [0.1, height, 0.0]) for height in (0.02, 0.0, -0.02)]


def skill(dim: int = 3, skill_dim: int | None = 2, scale_m: float = 0.05) -> Skill:
    """Straight to the origin, as if learned from straight demonstrations."""
    field = schema.LinearField(skill_dim, min_rate_per_duration=0.1, initial_rate_per_duration=2.0)
    config = ModelConfig(schema.IdentityChart(), field, schema.NoRegulariser(), seed=0)
    geometry = Geometry((0.05, 0.0, 0.0)[:dim], scale_m, (0.05, 0.0, 0.0)[:dim], (0.0,) * dim, duration_s=1.0)
    return Skill(models.build(config, geometry).eval(), config, geometry, ("position_m",), (0, 1, 2), ())


def ball(centre: tuple[float, ...] = (0.05, 0.0, 0.0), radius: float = 0.006) -> MovingBody:
    return MovingBody.at_its_velocity("sphere", Sphere(torch.tensor(centre, dtype=torch.float64), radius))


@pytest.fixture(scope="module")
def among_obstacles() -> SafeSkill:
    return safe_skill(skill(), DEMONSTRATED, [ball()], SETTINGS)


def test_nodes_in_the_obstacle_are_unsafe(among_obstacles):
    is_inside = among_obstacles.node_clearance_m < 0
    assert is_inside.any()
    assert (distance_on_grid(among_obstacles.reasons)[is_inside] <= SETTINGS.rho * (1 + 1e-9)).all()


def test_the_obstacle_is_where_the_decoder_says(among_obstacles):
    node = among_obstacles.nodes.grid.nodes[among_obstacles.node_clearance_m.argmin()]
    position = among_obstacles.surface.plane.positions(torch.from_numpy(node)[None])[0, 0]
    assert (position - torch.tensor([0.05, 0.0, 0.0])).norm() < 0.003


def test_demonstrated_states_are_undisturbed_where_no_obstacle_is(among_obstacles):
    codes = torch.from_numpy(np.concatenate(among_obstacles.surface.codes))
    assert among_obstacles.support.distance(codes).min() > 0.9 * SETTINGS.nu  # exactly ν, but for the interpolation


def test_reported_clearances_are_never_above_true_ones(among_obstacles):
    grid = among_obstacles.nodes.grid
    points = np.random.default_rng(0).uniform(grid.low, grid.high, size=(500, 2))
    positions = among_obstacles.surface.plane.positions(torch.from_numpy(points))[:, 0]
    exact = ball().signed_distance(positions.numpy(), 0.0)
    assert (among_obstacles.clearance_m(points) <= exact + 1e-9).all()


def test_the_volume_does_not_depend_on_latent_coordinates(among_obstacles):
    """The same states on a grid of twice the latent size and half the scale of the chart."""
    nodes = among_obstacles.nodes
    stretched = replace(nodes, grid=replace(nodes.grid, low=2 * nodes.grid.low, high=2 * nodes.grid.high))
    np.testing.assert_allclose(stretched.volume(), nodes.volume(), rtol=1e-9)


def test_the_geodesic_goes_around_the_obstacle(among_obstacles):
    path = among_obstacles.geodesic(among_obstacles.surface.codes[1][0])
    assert among_obstacles.clearance_m(path).min() > 0
    np.testing.assert_allclose(path[-1], among_obstacles.goal[0], atol=among_obstacles.nodes.grid.cell.max())


def test_the_charted_field_is_the_latent_one_in_the_coordinates_of_the_robot(among_obstacles):
    x = torch.tensor([[0.06, 0.0, 0.004], [0.03, 0.01, 0.0]])
    z, push_forward = among_obstacles.skill.field.chart.linearise(x)
    latent = among_obstacles.safe_field()(z.double()).float()
    torch.testing.assert_close(among_obstacles.charted_field()(x), push_forward(latent), atol=1e-5, rtol=1e-4)


@pytest.mark.parametrize(
    ("wrong", "bodies"),
    [
        (skill(skill_dim=None), []),
        (skill(), [ball(centre=(0.0, 0.0, 0.0))]),
        (skill(), [MovingBody("sphere", ball().body, ConstantVelocity(np.array([0.1, 0.0, 0.0])))]),
        (replace(skill(), state_channels=("joints_rad",)), []),
    ],
    ids=["three dimensions", "over the goal", "moving", "joints"],
)
def test_what_does_not_fit_is_refused(wrong, bodies):
    with pytest.raises(InvalidSetting):
        safe_skill(wrong, DEMONSTRATED, bodies, SETTINGS)


def test_an_obstacle_that_is_out_of_the_way_is_named():
    with pytest.raises(MissingData, match="obstacle"):
        safe_skill(skill(), DEMONSTRATED, [ball(centre=(0.05, 0.0, 0.5))], SETTINGS)
