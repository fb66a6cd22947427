"""A cushion: a rounded, squashed body that looks soft. It is rigid, and its contacts yield."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from geomotion.types import Float, Int

AROUND, ALONG = 24, 12  # facets
MASS_KG = 0.1
FRICTION = {"lateralFriction": 1.0, "spinningFriction": 0.01, "rollingFriction": 0.001}


@dataclass(frozen=True)
class Cushion:
    """The superellipsoid Σ |x_i / a_i|^p ≤ 1, lying on its flat side.

    Attributes:
        half_axes_m: a [m]; the hand closes along the second.
        roundness: p; 2 is an ellipsoid, more is nearer to a box.
    """

    half_axes_m: tuple[float, float, float] = (0.035, 0.022, 0.020)
    roundness: float = 4.0

    def surface(self) -> tuple[Float[np.ndarray, "vertex 3"], Int[np.ndarray, "face 3"], Float[np.ndarray, "vertex 2"]]:
        """Vertices [m], triangles seen from outside, and places of the vertices on a texture."""
        azimuth, elevation = np.meshgrid(
            np.linspace(-np.pi, np.pi, AROUND + 1), np.linspace(-np.pi / 2, np.pi / 2, ALONG + 1)
        )
        level = self._bent(np.cos(elevation))
        unit = np.stack(
            [level * self._bent(np.cos(azimuth)), level * self._bent(np.sin(azimuth)), self._bent(np.sin(elevation))],
            -1,
        )
        texture = np.stack([azimuth / (2 * np.pi) + 0.5, elevation / np.pi + 0.5], -1)
        corner = np.arange(ALONG)[:, None] * (AROUND + 1) + np.arange(AROUND)
        right, above, across = corner + 1, corner + AROUND + 1, corner + AROUND + 2
        faces = np.concatenate(
            [np.stack(three, -1).reshape(-1, 3) for three in ((corner, right, across), (corner, across, above))]
        )
        return (unit * np.array(self.half_axes_m)).reshape(-1, 3), faces, texture.reshape(-1, 2)

    def _bent(self, values: Float[np.ndarray, "*any"]) -> Float[np.ndarray, "*any"]:
        return np.asarray(np.sign(values) * np.abs(values) ** (2 / self.roundness))


def add_cushion(client: Any, cushion: Cushion) -> int:
    """Put a cushion into a simulator; the number of its body."""
    vertices, faces, texture = cushion.surface()
    normals = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    visual = client.createVisualShape(
        client.GEOM_MESH,
        vertices=vertices.tolist(),
        indices=faces.ravel().tolist(),
        uvs=texture.tolist(),
        normals=normals.tolist(),
    )
    collision = client.createCollisionShape(client.GEOM_MESH, vertices=vertices.tolist())  # their convex hull
    body: int = client.createMultiBody(MASS_KG, collision, visual)
    client.changeDynamics(body, -1, **FRICTION)
    return body
