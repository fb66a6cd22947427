"""Closed surfaces: orientation, what they enclose, kernels against hand-made bodies, and samples that cover."""

import numpy as np
import pytest
import trimesh

from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.obstacles.boundary import Boundary, deepest_point

L_SHAPE = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=float)
U_SHAPE = np.array([[0, 0], [3, 0], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]], dtype=float)


@pytest.mark.parametrize("turn", [1, -1])
def test_a_polygon_faces_outwards_whichever_way_its_corners_go(turn):
    boundary = Boundary.of_polygon(L_SHAPE[::turn])
    assert boundary.volume == pytest.approx(3)
    middles = boundary.vertices[boundary.simplices].mean(axis=1)
    heights = (boundary.normals * (middles - [0.5, 0.5])).sum(axis=1)
    np.testing.assert_allclose(np.sort(heights), [0.5, 0.5, 0.5, 0.5, 1.5, 1.5])


def test_a_mesh_faces_outwards_and_encloses_its_volume():
    box = trimesh.creation.box(extents=[1, 2, 3])
    for faces in (box.faces, box.faces[:, ::-1]):
        boundary = Boundary.of_mesh(np.asarray(box.vertices), np.asarray(faces))
        assert boundary.volume == pytest.approx(6)
        np.testing.assert_allclose(np.sort(np.unique(boundary.offsets.round(9))), [0.5, 1, 1.5])


def test_the_kernel_of_an_l_is_the_square_in_its_corner_and_a_u_has_none():
    ell, u = Boundary.of_polygon(L_SHAPE), Boundary.of_polygon(U_SHAPE)
    centre, depth = deepest_point(ell.normals, ell.offsets)
    np.testing.assert_allclose(centre, [0.5, 0.5], atol=1e-9)
    assert depth == pytest.approx(0.5)
    assert deepest_point(u.normals, u.offsets)[1] <= 0
    assert not ell.is_convex
    assert Boundary.of_polygon(L_SHAPE[:3]).is_convex


def test_samples_cover_every_face_within_the_angle():
    box = trimesh.creation.box(extents=[1, 0.3, 0.5])
    for boundary in (Boundary.of_polygon(L_SHAPE), Boundary.of_mesh(np.asarray(box.vertices), np.asarray(box.faces))):
        centre, _ = deepest_point(boundary.normals, boundary.offsets)
        points, faces = boundary.samples(centre, 0.1)
        assert np.abs(np.einsum("pd,pd->p", boundary.normals[faces], points) - boundary.offsets[faces]).max() < 1e-12
        generator = np.random.default_rng(0)
        for face, corners in enumerate(boundary.vertices[boundary.simplices]):
            inside = generator.dirichlet(np.ones(len(corners)), size=50) @ corners - centre
            own = points[faces == face] - centre
            cosines = (inside @ own.T) / np.outer(np.linalg.norm(inside, axis=1), np.linalg.norm(own, axis=1))
            assert np.arccos(cosines.max(axis=1).clip(max=1)).max() < 0.1


def test_what_encloses_nothing_or_is_not_closed_is_refused():
    box = trimesh.creation.box()
    vertices, faces = np.asarray(box.vertices), np.asarray(box.faces)
    with pytest.raises(InvalidSetting, match="watertight"):
        Boundary.of_mesh(vertices, faces[1:])
    with pytest.raises(InvalidSetting, match="consistently"):
        Boundary.of_mesh(vertices, np.concatenate([faces[:1, ::-1], faces[1:]]))
    with pytest.raises(InvalidSetting, match="Self-intersection"):
        Boundary.of_polygon(np.array([[0, 0], [1, 0], [0, 1], [1, 1.0]]))
    with pytest.raises(InvalidSetting, match="three corners"):
        Boundary.of_polygon(np.zeros((2, 2)))
    with pytest.raises(InvalidSetting, match="finite"):
        Boundary.of_polygon(np.array([[0, 0], [1, 0], [0, np.nan]]))
    with pytest.raises(InvalidSetting, match="with an inside"):
        Boundary(np.array([[0, 0], [1, 0], [2, 0.0]]), np.array([[0, 1], [1, 2], [2, 0]]))
    with pytest.raises(ShapeMismatch, match="2 or 3"):
        Boundary(np.zeros((5, 4)), np.array([[0, 1, 2, 3]]))
