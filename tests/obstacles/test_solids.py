"""Spheres, ellipsoids and boxes: distances against closed forms and polygons, Γ against what modulation needs of it."""

import numpy as np
import pytest
import shapely
import torch
from torch.testing import assert_close

from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.obstacles.obstacle import Obstacle, clearance, surface_points
from geomotion.obstacles.solids import Box, Ellipsoid, Solid, Sphere, unit

SEMI_AXES, SIDES, ROUNDING = [0.3, 0.1, 0.15], [0.6, 0.2, 0.3], 0.04


def rotation(dim: int) -> torch.Tensor:
    skew = torch.linspace(0.3, 1.1, dim * dim).double().reshape(dim, dim)
    return torch.linalg.matrix_exp(skew - skew.T)


def make(kind: str, dim: int) -> Solid:
    centre = torch.tensor([0.2, -0.1, 0.4, 0.0]).double()[:dim]
    match kind:
        case "sphere":
            return Sphere(centre, 0.2)
        case "ellipsoid":
            return Ellipsoid(centre, [*SEMI_AXES, 0.2][:dim], rotation(dim))
    return Box(centre, [*SIDES, 0.4][:dim], ROUNDING, rotation(dim))


KINDS = ("sphere", "ellipsoid", "box")
SOLIDS = [(kind, dim) for kind in KINDS for dim in (2, 3, 4)]


def directions(dim: int, count: int = 200) -> torch.Tensor:
    return unit(torch.randn(count, dim, generator=torch.Generator().manual_seed(dim)).double())


def gradient(function, x: torch.Tensor) -> torch.Tensor:
    x = x.clone().requires_grad_()
    return torch.autograd.grad(function(x).sum(), x)[0]


@pytest.mark.parametrize(("kind", "dim"), SOLIDS)
def test_level_is_one_at_the_surface_where_distance_is_zero(kind, dim):
    solid = make(kind, dim)
    assert isinstance(solid, Obstacle)
    points = surface_points(solid, directions(dim))
    assert_close(solid.level(points), torch.ones(200).double())
    assert_close(solid.signed_distance(points), torch.zeros(200).double(), atol=1e-14, rtol=0)


@pytest.mark.parametrize(("kind", "dim"), SOLIDS)
def test_level_grows_along_every_ray_from_the_reference_point(kind, dim):
    solid = make(kind, dim)
    rays = directions(dim)[:, None] * torch.logspace(-2, 2, 400).double()[:, None]
    levels = solid.level(solid.reference + rays)
    assert (levels.diff(dim=1) >= 0).all()
    outside = levels[:, 1:] > 1
    assert (levels.diff(dim=1)[outside] > 0).all()
    assert ((levels < 1) == (solid.signed_distance(solid.reference + rays) < 0)).all()


@pytest.mark.parametrize(("kind", "dim"), SOLIDS)
def test_level_is_continuously_differentiable_outside_along_its_normal(kind, dim):
    solid = make(kind, dim)
    surface = surface_points(solid, directions(dim))
    for stretch in (1.0, 1.3, 4.0):
        x = solid.reference + stretch * (surface - solid.reference)
        slope = gradient(solid.level, x)
        assert_close(unit(slope), solid.normal(x))
        step = 1e-6 * torch.eye(dim).double()
        differences = (solid.level(x[:, None] + step) - solid.level(x[:, None] - step)) / 2e-6
        assert_close(differences, slope, atol=1e-6, rtol=1e-6)
        beside = gradient(solid.level, x + 1e-7 * directions(dim).flip(0))
        assert_close(beside, slope, atol=1e-4, rtol=1e-4)  # Lipschitz, so 1e-7 apart changes it by about 1e-5


@pytest.mark.parametrize(("kind", "dim"), SOLIDS)
def test_distance_has_a_slope_of_one(kind, dim):
    solid = make(kind, dim)
    x = solid.reference + torch.linspace(0.4, 2.0, 200).double()[:, None] * directions(dim)
    x = x[solid.signed_distance(x) > 0]
    slope = gradient(solid.signed_distance, x)
    assert_close(slope.norm(dim=-1), torch.ones(len(x)).double())
    nearest = x - solid.signed_distance(x)[:, None] * slope
    assert_close(solid.level(nearest), torch.ones(len(x)).double())
    assert_close(solid.normal(nearest), slope, atol=1e-7, rtol=0)


@pytest.mark.parametrize("kind", KINDS)
def test_distance_in_a_plane_is_that_of_a_fine_polygon(kind):
    solid = make(kind, 2)
    angles = np.linspace(0, 2 * np.pi, 4001)[:-1]
    match kind:
        case "box":
            core = np.array(SIDES[:2]) / 2 - ROUNDING
            outline = shapely.box(*-core, *core).buffer(ROUNDING, quad_segs=1000)
        case _:
            axes = (0.2, 0.2) if kind == "sphere" else SEMI_AXES
            outline = shapely.Polygon(np.stack([axes[0] * np.cos(angles), axes[1] * np.sin(angles)], axis=1))
    body = torch.rand(300, 2, generator=torch.Generator().manual_seed(1)).double() - 0.5
    points = shapely.points(body.numpy())
    expected = shapely.distance(points, outline.exterior) * np.where(shapely.contains(outline, points), -1, 1)
    found = solid.signed_distance(solid.reference + solid.to_world(body))
    assert_close(found, torch.tensor(expected), atol=1e-6, rtol=0)


def test_the_centre_of_an_ellipsoid_lies_a_shortest_semi_axis_deep():
    solid = make("ellipsoid", 3)
    assert_close(solid.signed_distance(solid.reference[None]), torch.tensor([-0.1]).double())


@pytest.mark.parametrize("kind", KINDS)
def test_single_precision_and_any_batch_shape_are_served(kind):
    solid = make(kind, 3)
    x = solid.reference + 0.5 * directions(3).reshape(2, 5, 20, 3)
    single = make(kind, 3).float()
    assert single.signed_distance(x.float()).dtype == torch.float32
    assert_close(single.signed_distance(x.float()).double(), solid.signed_distance(x), atol=1e-6, rtol=1e-5)
    assert solid.level(x).shape == (2, 5, 20)
    assert_close(solid.normal(x)[1, 3], solid.normal(x[1, 3]))


def test_clearance_follows_moving_obstacles():
    still = Sphere(torch.tensor([0.0, 1.0]).double(), 0.25)
    moving = Sphere(torch.zeros(2).double(), 0.1, torch.tensor([1.0, 0.0]).double())
    times = torch.linspace(0, 2, 3).double()
    states = torch.tensor([[[0.3, 0.0], [1.2, 0.0], [2.5, 0.0]]]).double()
    assert_close(clearance([still, moving], states, times), torch.tensor([0.1]).double())


def test_lengths_that_make_no_body_are_refused():
    centre = torch.zeros(2)
    with pytest.raises(InvalidSetting, match="radius"):
        Sphere(centre, 0.0)
    with pytest.raises(InvalidSetting, match="shortest side"):
        Box(centre, [1.0, 0.2], 0.11)
    with pytest.raises(ShapeMismatch, match="semi_axes"):
        Ellipsoid(centre, [1.0])
    with pytest.raises(ShapeMismatch, match="rotation"):
        Ellipsoid(centre, [1.0, 1.0], torch.eye(3))
