"""Surfaces on which values on a grid reach a level, as triangles."""

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from jaxtyping import Bool, Float, Int

# Edges of a tetrahedron that a surface crosses, as pairs of corners, triangle by triangle: by the number of corners
# above the level, which come first.
CROSSED: dict[int, tuple[tuple[tuple[int, int], ...], ...]] = {
    1: (((0, 1), (0, 2), (0, 3)),),
    2: (((0, 2), (0, 3), (1, 3)), ((0, 2), (1, 3), (1, 2))),
    3: (((0, 3), (1, 3), (2, 3)),),
}


@dataclass(frozen=True)
class Mesh:
    """Triangles in space.

    Attributes:
        vertices: Coordinates.
        faces: Numbers of the vertices of each triangle, in such an order that normals point to larger values.
    """

    vertices: Float[np.ndarray, "vertex 3"]
    faces: Int[np.ndarray, "face 3"]

    @property
    def normals(self) -> Float[np.ndarray, "face 3"]:
        """Twice the area of each triangle, along its normal."""
        first, second, third = self.vertices[self.faces.T]
        return np.cross(second - first, third - first)

    def simplified(self, cells: int) -> "Mesh":
        """Vertices in a cell made one, in their middle; with at most so many cells along each axis.

        Source: Rossignac, Borrel (1993), Multi-resolution 3D approximations for rendering complex scenes.
        """
        if len(self.vertices) == 0:
            return self
        low, extent = self.vertices.min(axis=0), np.ptp(self.vertices, axis=0).max()
        cell = ((self.vertices - low) / extent * cells).astype(int).clip(max=cells - 1)
        _, number, count = np.unique(cell @ (cells**2, cells, 1), return_inverse=True, return_counts=True)
        sums = np.stack([np.bincount(number, weights=axis) for axis in self.vertices.T], axis=1)
        faces = number[self.faces]
        is_kept = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
        return Mesh(sums / count[:, None], faces[is_kept])


def isosurface(axes: tuple[Float[np.ndarray, " _"], ...], values: Float[np.ndarray, "nx ny nz"], level: float) -> Mesh:
    """Marching tetrahedra: every cell is cut into six, on which values are taken as linear.

    Closed except on the border of the grid. A page of numpy; marching cubes would need an image library for this alone.

    Args:
        axes: Coordinates along each axis, increasing.
        values: At the nodes.
        level: Where the surface is.

    Source: Doi, Koide (1991), An efficient method of triangulating equi-valued surfaces by using tetrahedral cells.
    """
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    flat = values.ravel()
    corners, above = _crossed_tetrahedra(values > level)
    counts = above.sum(axis=1)
    corners = np.take_along_axis(corners, np.argsort(~above, axis=1, kind="stable"), axis=1)
    edges, uphill = [], []
    for count, triangles in CROSSED.items():
        mine = corners[counts == count]
        rise = nodes[mine[:, :count]].mean(axis=1) - nodes[mine[:, count:]].mean(axis=1)
        for triangle in triangles:
            edges.append(mine[:, np.array(triangle)])
            uphill.append(rise)
    ends = np.sort(np.concatenate(edges), axis=-1).reshape(-1, 2)
    numbers, faces = np.unique(ends[:, 0] * len(flat) + ends[:, 1], return_inverse=True)
    first, second = np.divmod(numbers, len(flat))
    share = ((level - flat[first]) / (flat[second] - flat[first]))[:, None]
    mesh = Mesh(nodes[first] * (1 - share) + nodes[second] * share, faces.reshape(-1, 3))
    is_turned = np.einsum("fd,fd->f", mesh.normals, np.concatenate(uphill)) < 0
    return Mesh(mesh.vertices, np.where(is_turned[:, None], mesh.faces[:, ::-1], mesh.faces))


def _crossed_tetrahedra(
    is_above: Bool[np.ndarray, "nx ny nz"],
) -> tuple[Int[np.ndarray, "tetrahedron 4"], Bool[np.ndarray, "tetrahedron 4"]]:
    """Nodes at the corners of tetrahedra with corners on both sides, and which of them are above.

    All six of a cell have its main diagonal in common, in all cells the same one, so that neighbours fit.
    """
    numbers = np.arange(is_above.size).reshape(is_above.shape)
    found = []
    for order in permutations(range(3)):
        steps = np.cumsum([np.zeros(3, dtype=int), *np.eye(3, dtype=int)[list(order)]], axis=0)
        cuts = [tuple(map(slice, step, step + np.array(is_above.shape) - 1)) for step in steps]
        found.append(np.stack([numbers[cut].ravel() for cut in cuts], axis=1))
    corners = np.concatenate(found)
    above = is_above.ravel()[corners]
    is_crossed = above.any(axis=1) & ~above.all(axis=1)
    return corners[is_crossed], above[is_crossed]
