"""Meshes: distances never above those of closed forms, and not far below; holes; what is refused."""

from functools import cache

import numpy as np
import pytest
import torch

from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.obstacles.body import Body
from geomotion.obstacles.mesh import Mesh, open_edges, sample_surface
from geomotion.obstacles.solids import Solid, Sphere

SIDES = np.array([0.3, 0.2, 0.1])
SHIFT = np.array([0.4, -0.2, 0.1])
ROUNDING = 1e-12
SAG = 0.1 * (1 - np.cos(np.pi / 60)) * 1.5  # how far faces of the inscribed mesh may lie below the sphere [m]


def box_mesh() -> tuple[np.ndarray, np.ndarray]:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * SIDES / 2 + SHIFT
    quads = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
    return corners, np.array([[q[i] for i in corner] for q in quads for corner in ((0, 1, 2), (0, 2, 3))])


def box_distance(x: np.ndarray) -> np.ndarray:
    beyond = np.abs(x - SHIFT) - SIDES / 2
    return np.linalg.norm(beyond.clip(min=0), axis=1) + beyond.max(axis=1).clip(max=0)


def sphere_mesh(radius: float = 0.1, rings: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Vertices on a sphere, its poles included."""
    polar, around = np.meshgrid(np.linspace(0, np.pi, rings + 1)[1:-1], np.arange(rings) * 2 * np.pi / rings)
    ring = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1)
    vertices = np.concatenate([ring.swapaxes(0, 1).reshape(-1, 3), [[0, 0, 1], [0, 0, -1]]])
    index = np.arange(rings * (rings - 1)).reshape(rings - 1, rings)
    a, b = index[:-1], index[1:]
    c, d = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    sides = np.concatenate([np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((a, b, c), (c, b, d))])
    caps = [
        np.stack([index[row], np.roll(index[row], -1), np.full(rings, pole)], axis=1)
        for row, pole in ((0, len(vertices) - 2), (-1, len(vertices) - 1))
    ]
    return radius * vertices + SHIFT, np.concatenate([sides, *caps])


@cache
def body(kind: str) -> Mesh:
    return Mesh(*(box_mesh() if kind == "box" else sphere_mesh()))


def truth(kind: str, x: np.ndarray) -> np.ndarray:
    """Exact for the box; to the sphere that the mesh is inscribed in."""
    return box_distance(x) if kind == "box" else np.linalg.norm(x - SHIFT, axis=1) - 0.1


def states(count: int = 4000, size: float = 0.6, seed: int = 0) -> np.ndarray:
    return SHIFT + size * (np.random.default_rng(seed).random((count, 3)) - 0.5)


@pytest.mark.parametrize("kind", ["box", "sphere"])
def test_a_distance_is_never_above_the_true_one(kind):
    for size in (0.35, 0.6, 3.0):
        x = states(size=size)
        found = body(kind).signed_distance(torch.from_numpy(x)).numpy()
        assert (found <= truth(kind, x) + (ROUNDING if kind == "box" else SAG)).all()


def test_a_mesh_of_a_sphere_loses_no_more_than_the_stated_error_against_the_sphere():
    x = torch.from_numpy(states())
    ball = Sphere(torch.from_numpy(SHIFT), 0.1)
    lost = ball.signed_distance(x) - body("sphere").signed_distance(x)
    is_near = (ball.signed_distance(x).abs() < 0.02).numpy()
    assert lost[is_near].max() < body("sphere").error_m
    assert lost[is_near & (ball.signed_distance(x) > 0.01).numpy()].max() < 0.002


def test_next_to_the_box_a_distance_lies_below_the_true_one_by_at_most_the_stated_error():
    mesh, h = body("box"), 0.3 / 64
    x = states(20_000)
    x = x[(np.abs(x - SHIFT) < SIDES / 2 + 8 * h).all(axis=1)]
    lost = truth("box", x) - mesh.signed_distance(torch.from_numpy(x)).numpy()
    assert mesh.error_m == pytest.approx(2 * h)
    assert lost.max() < mesh.error_m
    outside = truth("box", x) > 3 * h
    assert lost[outside].max() < h / 2


def test_in_the_coarse_grid_it_lies_below_by_at_most_eight_steps_and_mostly_far_less():
    x = states(20_000)
    lost = truth("box", x) - body("box").signed_distance(torch.from_numpy(x)).numpy()
    assert lost.max() < 8 * 0.3 / 64
    assert np.median(lost) < 0.002


def test_distances_change_no_faster_than_the_state_moves_but_for_the_error():
    mesh = body("box")
    x, y = torch.from_numpy(states(seed=1)), torch.from_numpy(states(seed=2))
    y = x + 0.1 * (y - x)
    change = (mesh.signed_distance(x) - mesh.signed_distance(y)).abs()
    assert (change <= (x - y).norm(dim=-1) + 2 * mesh.error_m).all()


def test_a_ball_around_a_state_with_its_distance_as_radius_meets_no_surface():
    x = states(500)
    found = body("box").signed_distance(torch.from_numpy(x)).numpy()
    directions = np.random.default_rng(3).normal(size=(500, 50, 3))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    on_ball = x[:, None] + found.clip(min=0)[:, None, None] * directions
    assert (box_distance(on_ball[found > 0].reshape(-1, 3)) >= -ROUNDING).all()


@pytest.mark.parametrize(("kind", "depth_m"), [("box", 0.05), ("sphere", 0.1)])
def test_the_reference_point_lies_deep_inside(kind, depth_m):
    mesh = body(kind)
    assert isinstance(mesh, Body) and isinstance(mesh, Solid)
    assert depth_m - 0.004 < mesh.inradius <= -truth(kind, mesh.reference.numpy()[None])[0]
    vertices = box_mesh()[0] if kind == "box" else sphere_mesh()[0]
    farthest = np.linalg.norm(vertices - mesh.reference.numpy(), axis=1).max()
    np.testing.assert_allclose(mesh.bounding_radius, farthest)


def test_a_small_hole_leaves_the_inside_as_it_is():
    vertices, faces = sphere_mesh()
    pierced = Mesh(vertices, faces[:-1], cells=32)
    assert not pierced.is_watertight and body("sphere").is_watertight
    assert pierced.signed_distance(torch.from_numpy(SHIFT)[None]) < -0.09


def test_a_box_without_its_lid_is_a_shell_with_free_room_inside():
    vertices, faces = box_mesh()
    shell = Mesh(vertices, faces[2:])
    deep = torch.from_numpy(SHIFT)[None]
    assert 0.04 < shell.signed_distance(deep) <= 0.05
    assert shell.is_shell and not body("box").is_shell
    assert shell.inradius == pytest.approx(0.3 / 64)
    on_wall = torch.from_numpy(SHIFT + np.array([SIDES[0] / 2, 0, 0]))[None]
    assert shell.signed_distance(on_wall) < 0


def test_faces_within_the_body_bound_nothing():
    vertices, faces = box_mesh()
    across = SHIFT + np.array([[0, -0.1, -0.05], [0, -0.1, 0.05], [0, 0.1, 0.05], [0, 0.1, -0.05]])
    divided = Mesh(np.concatenate([vertices, across]), np.concatenate([faces, [[8, 9, 10], [8, 10, 11]]]))
    on_divider = torch.from_numpy(SHIFT)[None]
    assert divided.signed_distance(on_divider) < -0.04
    assert divided.inradius > 0.035


def test_open_edges_are_counted():
    _, faces = box_mesh()
    assert [open_edges(faces), open_edges(faces[1:]), open_edges(faces[2:])] == [0, 3, 4]


def test_samples_cover_every_triangle_within_the_spacing():
    generator = np.random.default_rng(5)
    for triangle in generator.normal(size=(20, 3, 3)):
        samples = sample_surface(triangle[None], 0.2)
        inside = generator.dirichlet(np.ones(3), size=500) @ triangle
        edges = triangle[:2] + generator.random((200, 1, 1)) * (triangle[1:] - triangle[:2])
        for points in (inside, edges.reshape(-1, 3)):
            assert np.linalg.norm(points[:, None] - samples, axis=-1).min(axis=1).max() <= 0.2


def test_any_batch_shape_and_single_precision_are_served_and_gradients_flow():
    x = torch.from_numpy(states(24)).reshape(2, 3, 4, 3)
    found = body("box").signed_distance(x)
    assert found.shape == (2, 3, 4)
    single = Mesh(*box_mesh()).float().signed_distance(x.float())
    torch.testing.assert_close(single.double(), found, atol=1e-4, rtol=0)
    near = torch.from_numpy(SHIFT + np.array([[0.17, 0, 0]])).requires_grad_()
    (slope,) = torch.autograd.grad(body("box").signed_distance(near).sum(), near)
    torch.testing.assert_close(slope, torch.tensor([[1.0, 0, 0]]).double(), atol=0.05, rtol=0)


def test_what_makes_no_body_is_refused():
    vertices, faces = box_mesh()
    with pytest.raises(InvalidSetting, match=r"mesh\.faces=none"):
        Mesh(vertices, faces[:0])
    with pytest.raises(ShapeMismatch, match="0 to 7, found 8"):
        Mesh(vertices, faces + 1)
    with pytest.raises(InvalidSetting, match="finite coordinates"):
        Mesh(np.where(vertices == vertices.max(), np.nan, vertices), faces)
    with pytest.raises(InvalidSetting, match="extent"):
        Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]]))
    with pytest.raises(InvalidSetting, match="cells=2"):
        Mesh(vertices, faces, cells=2)
