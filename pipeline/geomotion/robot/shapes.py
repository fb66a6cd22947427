"""Obstacles as shapes of PyBullet, such that its distances are those of the obstacles.

Seen by experiment, and held by the tests: a box with a collision margin is rounded by it, outer size unchanged; a hull
or mesh without one is exact; a query that finds tens of thousands of contact points crashes the process, so meshes are
cut into pieces; and balls of 20 triangles each are far too many for a cloud, so its points are specks and the radius is
taken off their distances.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
import torch

from geomotion.errors import ShapeMismatch
from geomotion.obstacles.solids import Box, Ellipsoid, Sphere
from geomotion.types import Float, Int, Tensor

FACES_PER_PIECE = 1000
SPECK_M = 1e-5  # side of the triangle that stands for a point
ICOSPHERE_SUBDIVISIONS = 4  # facets 0.06 % inside the ellipsoid
OCTAHEDRON = np.vstack([np.eye(3), -np.eye(3)])
OCTAHEDRON_FACES = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]])

Vertices = Float[np.ndarray, "vertex 3"]
Faces = Int[np.ndarray, "face 3"]


@runtime_checkable
class Surface(Protocol):
    """A body bounded by triangles: vertices [m] of shape (n, 3), faces of shape (m, 3)."""

    vertices: Any
    faces: Any


@runtime_checkable
class Cloud(Protocol):
    """Balls of one radius [m] around points [m] of shape (n, 3)."""

    points: Any
    radius: float


@dataclass(frozen=True)
class Shape:
    """What PyBullet needs to know of a body, and what it cannot be told.

    Attributes:
        collision: Arguments of ``createCollisionShape``, one dictionary per piece.
        visual: Arguments of ``createVisualShape``.
        position_m: Place of the shape's own frame [m].
        rotation: Its axes as columns.
        margin_m: Collision margin [m].
        skin_m: What the body extends beyond the shape on all sides [m].
    """

    collision: list[dict[str, Any]]
    visual: dict[str, Any]
    position_m: Float[np.ndarray, " 3"] = field(default_factory=lambda: np.zeros(3))
    rotation: Float[np.ndarray, "3 3"] = field(default_factory=lambda: np.eye(3))
    margin_m: float = 0.0
    skin_m: float = 0.0


def shape_of(body: object) -> Shape:
    """The shape of an obstacle.

    Args:
        body: A sphere, box, ellipsoid, triangle mesh or point cloud in three dimensions.

    Raises:
        ShapeMismatch: If it has another number of dimensions.
        TypeError: If it is none of these.
    """
    dim = getattr(body, "dim", 3)
    if dim != 3:
        raise ShapeMismatch("an obstacle in the robot's scene", "3 dimensions", dim)
    match body:
        case Surface():
            return mesh_shape(_array(body.vertices), _array(body.faces).astype(np.int64))
        case Cloud():
            return _cloud_shape(_array(body.points), float(body.radius))
        case Box():
            return _box_shape(body)
        case Ellipsoid():
            return _ellipsoid_shape(body)
        case Sphere():
            return _sphere_shape(body)
    raise TypeError(f"{body!r} is no body that the simulator knows")


def mesh_shape(vertices: Vertices, faces: Faces) -> Shape:
    """Triangles as they are, both sides solid; distances are those to the surface, also from within."""
    return Shape(list(_pieces(vertices, faces)), _drawn(vertices, faces))


def dots(points_m: Float[np.ndarray, "point 3"], radius_m: float) -> dict[str, Any]:
    """Arguments of ``createVisualShape`` for an octahedron around each point."""
    vertices, faces = _copies(OCTAHEDRON * radius_m, OCTAHEDRON_FACES, points_m)
    return _drawn(vertices, faces)


def _sphere_shape(body: Sphere) -> Shape:
    import pybullet

    ball = {"shapeType": pybullet.GEOM_SPHERE, "radius": body.inradius}
    return Shape([ball], ball, _array(body.reference))


def _box_shape(body: Box) -> Shape:
    import pybullet

    box = {"shapeType": pybullet.GEOM_BOX, "halfExtents": (_array(body.core) + body.rounding).tolist()}
    return Shape([box], box, _array(body.reference), _array(body.rotation), margin_m=body.rounding)


def _ellipsoid_shape(body: Ellipsoid) -> Shape:
    import pybullet
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=ICOSPHERE_SUBDIVISIONS)
    vertices = ball.vertices * _array(body.semi_axes)
    hull = {"shapeType": pybullet.GEOM_MESH, "vertices": vertices.tolist()}
    return Shape([hull], _drawn(vertices, ball.faces), _array(body.reference), _array(body.rotation))


def _cloud_shape(points: Vertices, radius_m: float) -> Shape:
    specks, faces = _copies(SPECK_M * (np.eye(3) - 1 / 3), np.array([[0, 1, 2]]), points)
    return Shape(list(_pieces(specks, faces)), dots(points, radius_m), skin_m=radius_m)


def _copies(
    vertices: Vertices, faces: Faces, places: Float[np.ndarray, "place 3"]
) -> tuple[Float[np.ndarray, "copied 3"], Int[np.ndarray, "copied_face 3"]]:
    """One triangulated body at many places."""
    shift = len(vertices) * np.arange(len(places))
    moved = (places[:, None] + vertices).reshape(-1, 3)
    return moved, (shift[:, None, None] + faces).reshape(-1, 3)


def _pieces(vertices: Vertices, faces: Faces) -> Iterator[dict[str, Any]]:
    import pybullet

    for start in range(0, len(faces), FACES_PER_PIECE):
        used, indices = np.unique(faces[start : start + FACES_PER_PIECE], return_inverse=True)
        yield {
            "shapeType": pybullet.GEOM_MESH,
            "vertices": vertices[used].tolist(),
            "indices": indices.ravel().tolist(),
            "flags": pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
        }


def _drawn(vertices: Vertices, faces: Faces) -> dict[str, Any]:
    """Corners are repeated for each triangle, so that each has its own normal: flat shading."""
    import pybullet

    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
    return {
        "shapeType": pybullet.GEOM_MESH,
        "vertices": corners.reshape(-1, 3).tolist(),
        "indices": list(range(3 * len(faces))),
        "normals": np.repeat(normals, 3, axis=0).tolist(),
    }


def _array(values: Tensor | np.ndarray) -> Any:
    return torch.as_tensor(values).detach().cpu().double().numpy()
