"""Ten arrangements of obstacles between random starts and a goal at the origin, in scenes of about a metre."""

import numpy as np
import torch
import trimesh

from geomotion.obstacles.boundary import Boundary
from geomotion.obstacles.enclosure import enclose
from geomotion.obstacles.obstacle import Obstacle
from geomotion.obstacles.solids import Box, Ellipsoid, Sphere


def at(*place: float) -> torch.Tensor:
    return torch.tensor(place).double()


def polygon(corners: list[list[float]], velocity: torch.Tensor | None = None) -> Obstacle:
    return enclose(Boundary.of_polygon(np.array(corners, dtype=float)), velocity=velocity)


def mesh(shape: trimesh.Trimesh, radii: np.ndarray | float, velocity: torch.Tensor | None = None) -> Obstacle:
    vertices = np.asarray(shape.vertices) * radii + [1.0, 0.0, 0.0]
    return enclose(Boundary.of_mesh(vertices, np.asarray(shape.faces)), velocity=velocity)


def star(points: int = 5) -> list[list[float]]:
    angles = np.arange(2 * points) * np.pi / points
    radii = np.where(np.arange(2 * points) % 2, 0.18, 0.4)
    return np.stack([1 + radii * np.cos(angles), radii * np.sin(angles)], axis=1).tolist()


def obstacle_sets() -> dict[str, tuple[Obstacle, ...]]:
    """By name; those that begin with "star-shaped" are not convex."""
    turn = torch.tensor([[0.8, -0.6], [0.6, 0.8]]).double()
    ball = trimesh.creation.icosphere(subdivisions=1)
    dents = 0.3 + 0.1 * np.cos(3 * ball.vertices[:, :1]) * np.cos(2 * ball.vertices[:, 1:2])
    return {
        "sphere": (Sphere(at(1, 0), 0.3),),
        "sphere in space": (Sphere(at(1, 0, 0), 0.3),),
        "ellipsoid": (Ellipsoid(at(1, 0), [0.2, 0.45], turn),),
        "box in space": (Box(at(1, 0, 0), [0.4, 0.8, 0.5], 0.08),),
        "convex polygon": (polygon([[0.7, -0.3], [1.2, -0.4], [1.4, 0.1], [0.9, 0.4]]),),
        "convex mesh": (mesh(trimesh.creation.box(), 0.5),),
        "several": (Sphere(at(1, 0.3), 0.2), Box(at(1, -0.4), [0.4, 0.5], 0.1), Sphere(at(-0.8, 0), 0.3)),
        "moving mesh and sphere": (
            mesh(trimesh.creation.icosahedron(), 0.3, at(0, 0.2, 0)),
            Sphere(at(-2, 0, 0.1), 0.2, at(1, 0, 0)),
        ),
        "star-shaped polygon": (polygon(star()),),
        "star-shaped mesh": (mesh(ball, dents),),
    }
