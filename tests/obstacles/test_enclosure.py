"""Obstacles around polygons and meshes: Γ against what modulation needs of it, containment, distances."""

import numpy as np
import pytest
import shapely
import torch
import trimesh
from torch.testing import assert_close

from geomotion.errors import InvalidSetting
from geomotion.obstacles.boundary import Boundary
from geomotion.obstacles.enclosure import enclose
from geomotion.obstacles.obstacle import Obstacle, overlap, surface_points
from geomotion.obstacles.polytope import Polytope
from geomotion.obstacles.solids import Sphere, unit
from geomotion.obstacles.star import StarShape

L_SHAPE = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=float) / 10


def star_polygon(points: int = 5) -> np.ndarray:
    angles = np.arange(2 * points) * np.pi / points
    radii = np.where(np.arange(2 * points) % 2, 0.12, 0.3)
    return np.array([0.5, 0.1]) + np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)


def bumpy_mesh() -> Boundary:
    ball = trimesh.creation.icosphere(subdivisions=1)
    radii = 0.2 + 0.08 * np.cos(3 * ball.vertices[:, :1]) * np.cos(2 * ball.vertices[:, 1:2])
    return Boundary.of_mesh(np.asarray(ball.vertices) * radii, np.asarray(ball.faces))


@pytest.fixture(scope="module")
def bodies() -> dict[str, tuple[Boundary | None, Obstacle]]:
    points = np.random.default_rng(0).normal(size=(12, 3)) * 0.1
    box = trimesh.creation.box(extents=[0.1, 0.2, 0.4])
    boundaries = {
        "triangle": Boundary.of_polygon(L_SHAPE[[0, 1, 4]]),
        "l": Boundary.of_polygon(L_SHAPE),
        "star": Boundary.of_polygon(star_polygon()),
        "box mesh": Boundary.of_mesh(np.asarray(box.vertices), np.asarray(box.faces)),
        "bumpy mesh": bumpy_mesh(),
    }
    found = {name: (boundary, enclose(boundary)) for name, boundary in boundaries.items()}
    return found | {"hull in space": (None, Polytope(points)), "hull in 4-D": (None, Polytope(np.eye(5)[:, :4]))}


NAMES = ("triangle", "l", "star", "box mesh", "bumpy mesh", "hull in space", "hull in 4-D")


def directions(dim: int, count: int = 200) -> torch.Tensor:
    return unit(torch.randn(count, dim, generator=torch.Generator().manual_seed(dim)).double())


def gradient(function, x: torch.Tensor) -> torch.Tensor:
    x = x.clone().requires_grad_()
    return torch.autograd.grad(function(x).sum(), x)[0]


def test_convex_bodies_become_polytopes_and_others_star_shapes(bodies):
    kinds = {name: type(body) for name, (_, body) in bodies.items()}
    assert {name for name in kinds if kinds[name] is StarShape} == {"l", "star", "bumpy mesh"}
    assert isinstance(enclose(Boundary.of_polygon(L_SHAPE), convex_hull=True), Polytope)


@pytest.mark.parametrize("name", NAMES)
def test_level_is_one_at_the_surface_and_grows_along_every_ray(bodies, name):
    _, body = bodies[name]
    assert isinstance(body, Obstacle)
    surface = surface_points(body, directions(body.dim))
    assert_close(body.level(surface), torch.ones(200).double())
    assert_close(body.signed_distance(surface), torch.zeros(200).double(), atol=1e-13, rtol=0)
    rays = directions(body.dim)[:, None] * torch.logspace(-3, 1, 300).double()[:, None]
    levels = body.level(body.reference + rays)
    assert (levels.diff(dim=1) > 0).all()
    assert ((levels < 1) == (body.signed_distance(body.reference + rays) < 0)).all()


@pytest.mark.parametrize("name", NAMES)
def test_level_is_continuously_differentiable_outside_along_its_normal(bodies, name):
    _, body = bodies[name]
    surface = surface_points(body, directions(body.dim))
    for stretch in (1.0, 1.2, 4.0):
        x = body.reference + stretch * (surface - body.reference)
        slope = gradient(body.level, x)
        assert_close(unit(slope), body.normal(x))
        offset = 1e-7 * directions(body.dim).flip(0)
        beside = gradient(body.level, x + offset)
        assert ((beside - slope).norm(dim=-1) / slope.norm(dim=-1)).max() < 1e-4  # Lipschitz
        assert ((x - body.reference) * body.normal(x)).sum(dim=-1).min() > 0


@pytest.mark.parametrize("name", ["triangle", "l", "star", "box mesh", "bumpy mesh"])
def test_the_avoided_body_contains_the_given_one(bodies, name):
    boundary, body = bodies[name]
    points, _ = boundary.samples(body.reference.numpy(), 0.02 if body.dim == 3 else 0.001)
    points = torch.from_numpy(points)
    assert body.level(points).max() < 1
    radii, surface = (points - body.reference).norm(dim=-1), unit(points - body.reference)
    grown = (surface_points(body, surface[::17]) - body.reference).norm(dim=-1) / radii[::17]
    assert grown.max() < 1.13


@pytest.mark.parametrize(("name", "by"), [("l", 0.05), ("l", 0.5), ("star", 0.5), ("bumpy mesh", 0.2)])
def test_a_grown_body_contains_all_that_is_near_the_given_one_and_not_much_more(bodies, name, by):
    boundary, body = bodies[name]
    grown = enclose(boundary, rounding=by)
    points = torch.from_numpy(boundary.samples(body.reference.numpy(), 0.05 if body.dim == 3 else 0.005)[0])
    around = points[:, None] + by * directions(body.dim)[:50]
    assert grown.level(around).max() < 1
    away = torch.cdist(surface_points(grown, directions(body.dim)), points).amin(dim=1)
    assert away.max() < by + 0.3 * body.bounding_radius


@pytest.mark.parametrize("name", NAMES)
def test_distances_never_exceed_the_true_one(bodies, name):
    _, body = bodies[name]
    surface = surface_points(body, directions(body.dim, 5000))
    x = body.reference + 0.5 * directions(body.dim)
    x = x[body.level(x) > 1]
    nearest = torch.cdist(x, surface).amin(dim=1)
    assert (body.signed_distance(x) < nearest + 1e-12).all()
    if isinstance(body, Polytope) and body.dim < 4:
        assert (nearest - body.signed_distance(x)).max() < 0.03


def test_the_distance_to_a_convex_polygon_is_that_of_shapely():
    corners = np.random.default_rng(1).normal(size=(9, 2))
    body = Polytope(corners, rounding=0.1)
    hull = shapely.MultiPoint(corners).convex_hull
    x = 3 * torch.randn(500, 2, generator=torch.Generator().manual_seed(0)).double()
    expected = shapely.distance(shapely.points(x.numpy()), hull) - 0.1
    is_outside = expected > -0.1
    assert_close(body.signed_distance(x)[is_outside], torch.from_numpy(expected[is_outside]))


def test_single_precision_is_served(bodies):
    for _, body in bodies.values():
        x = body.reference + 0.5 * directions(body.dim)
        single = enclose(Boundary.of_polygon(L_SHAPE)).float()
        assert single.normal(torch.ones(3, 2)).dtype == torch.float32
        assert body.level(x.reshape(2, 100, body.dim)).shape == (2, 100)


def test_bodies_that_are_not_star_shaped_or_flat_are_refused():
    u = np.array([[0, 0], [3, 0], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]], dtype=float)
    with pytest.raises(InvalidSetting, match="convex_hull"):
        enclose(Boundary.of_polygon(u))
    with pytest.raises(InvalidSetting, match="with an inside"):
        Polytope(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]]))
    with pytest.raises(InvalidSetting, match="rounding"):
        Polytope(L_SHAPE, rounding=0.0)


def test_overlap_is_seen_from_either_side(bodies):
    _, ell = bodies["l"]
    inner, apart = Sphere(torch.tensor([0.05, 0.05]).double(), 0.01), Sphere(torch.tensor([0.2, 0.2]).double(), 0.05)
    assert overlap(inner, ell)
    assert overlap(ell, Sphere(torch.tensor([0.2, 0.05]).double(), 0.05))
    assert not overlap(apart, ell) and not overlap(ell, apart)
