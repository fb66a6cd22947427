"""Surfaces of obstacles as vertices and faces, for pictures."""

import numpy as np
import torch
from jaxtyping import Float, Int

from geomotion.obstacles.body import Body
from geomotion.obstacles.mesh import Mesh
from geomotion.obstacles.obstacle import Obstacle, surface_points
from geomotion.obstacles.point_cloud import PointCloud

OUTLINE_POINTS = 100
SUBDIVISIONS = 3
MOST_POINTS = 400  # of a cloud that are drawn

Surface = tuple[Float[np.ndarray, "vertex D"], Int[np.ndarray, "face 3"]]


def outline(body: Body) -> Surface:
    """Vertices [m] and triangles in space; in a plane, points around the body and no triangle."""
    match body:
        case Mesh():
            return body.vertices.numpy(), body.faces.numpy()
        case PointCloud():
            return _specks(body)
        case Obstacle():
            directions, faces = _sphere() if body.dim == 3 else _circle()
            points = surface_points(body, torch.from_numpy(directions).to(body.reference))
            return points.double().numpy(), faces
    raise TypeError(f"no outline for {type(body).__name__}")


def _specks(cloud: PointCloud) -> Surface:
    """An octahedron for each of some points."""
    chosen = np.linspace(0, len(cloud.points) - 1, min(len(cloud.points), MOST_POINTS)).round().astype(int)
    if cloud.points.shape[1] == 2:
        return cloud.points[chosen], np.zeros((0, 3), dtype=int)
    corners = cloud.radius * np.concatenate([np.eye(3), -np.eye(3)])
    sides = [(a, b, c) for a in (0, 3) for b in (1, 4) for c in (2, 5)]
    vertices = (cloud.points[chosen][:, None] + corners).reshape(-1, 3)
    faces = (6 * np.arange(len(chosen))[:, None, None] + np.array(sides)).reshape(-1, 3)
    return vertices, faces


def _circle() -> Surface:
    angles = np.linspace(0, 2 * np.pi, OUTLINE_POINTS + 1)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1), np.zeros((0, 3), dtype=int)


def _sphere() -> Surface:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=SUBDIVISIONS)
    return np.asarray(ball.vertices, dtype=np.float64), np.asarray(ball.faces, dtype=np.int64)
