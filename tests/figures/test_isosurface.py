"""Surfaces of a level against closed forms."""

import numpy as np
import pytest

from geomotion.figures.isosurface import Mesh, isosurface

AXES = tuple(np.linspace(-1.2, 1.2 + 0.1 * number, 22 + number) for number in range(3))
RADIUS = 0.9


def distance(centre=(0.0, 0.0, 0.0)):
    places = np.stack(np.meshgrid(*AXES, indexing="ij"), axis=-1)
    return np.linalg.norm(places - centre, axis=-1)


def volume(mesh):
    """By the divergence theorem."""
    first, second, third = mesh.vertices[mesh.faces.T]
    return np.einsum("fd,fd->", first, np.cross(second, third)) / 6


def area(mesh):
    return np.linalg.norm(mesh.normals, axis=1).sum() / 2


def uses_of_edges(mesh):
    edges = np.sort(np.concatenate([mesh.faces[:, pair] for pair in ([0, 1], [1, 2], [2, 0])]), axis=1)
    return np.unique(edges, axis=0, return_counts=True)[1]


def test_a_sphere_is_closed_and_has_its_radius_area_and_volume():
    mesh = isosurface(AXES, distance(), RADIUS)
    assert (uses_of_edges(mesh) == 2).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), RADIUS, rtol=0.01)
    assert area(mesh) == pytest.approx(4 * np.pi * RADIUS**2, rel=0.01)
    assert volume(mesh) == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.015)


@pytest.mark.parametrize("sign", [1, -1])
def test_normals_point_to_larger_values(sign):
    mesh = isosurface(AXES, sign * distance(), sign * RADIUS)
    outwards = mesh.vertices[mesh.faces].mean(axis=1)
    assert (sign * np.einsum("fd,fd->f", mesh.normals, outwards) >= 0).all()


def test_linear_values_are_cut_exactly_in_a_plane():
    direction = np.array([0.3, -0.5, 0.8])
    values = np.stack(np.meshgrid(*AXES, indexing="ij"), axis=-1) @ direction
    mesh = isosurface(AXES, values, 0.123)
    np.testing.assert_allclose(mesh.vertices @ direction, 0.123, atol=1e-12)


def test_where_no_value_is_crossed_there_is_no_surface():
    mesh = isosurface(AXES, distance(), 99.0)
    assert mesh.vertices.shape == mesh.faces.shape == mesh.simplified(5).faces.shape == (0, 3)


def test_a_simplified_surface_is_smaller_and_near_the_same_place():
    mesh = isosurface(AXES, distance(), RADIUS)
    simple = mesh.simplified(12)
    assert len(simple.faces) < len(mesh.faces) / 4
    np.testing.assert_allclose(np.linalg.norm(simple.vertices, axis=1), RADIUS, rtol=0.06)
    assert area(simple) == pytest.approx(area(mesh), rel=0.06)
    assert set(np.unique(simple.faces)) == set(range(len(simple.vertices)))


def test_triangles_with_two_equal_corners_are_left_out():
    corners = np.array([[0.0, 0, 0], [0.01, 0, 0], [1, 0, 0], [0, 1, 0]])
    simple = Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]])).simplified(2)
    assert len(simple.vertices) == 3 and len(simple.faces) == 1
