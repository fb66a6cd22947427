"""Triangle meshes: distances from two voxel grids, filled once, that never claim more room than there is."""

from collections.abc import Sequence
from itertools import product

import numpy as np
import torch
from scipy.ndimage import distance_transform_edt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.obstacles.solids import Solid, length
from geomotion.obstacles.voxels import Grid, Nodes
from geomotion.types import Bool, Float, Int, State, Tensor

Points = Float[np.ndarray, "point 3"]
Faces = Int[np.ndarray, "face 3"]
Voxels = Float[np.ndarray, "x y z"]

MARGIN = 8  # steps of the fine grid between the body and its end
COARSENESS = 4  # steps of the fine grid in one of the coarse grid
NEAR = 2  # steps of a grid: nodes closer to the surface are measured against the dense samples
LEAF = 64  # samples; for thousands of nodes that ask in a row, faster than the usual 16
DENSE, SPARSE = 1 / 4, 1  # steps of the fine grid within which samples cover the surface
FORWARD = [offset for offset in product((-1, 0, 1), repeat=3) if offset > (0, 0, 0)]  # 13 of 26 neighbours


class Mesh(Solid):
    """A body bounded by triangles.

    Distances come from a grid with step h around the mesh and from one with step 4h around that, see
    :class:`geomotion.obstacles.voxels.Grid`. They are never above the true one, and below it by at most ``error_m``,
    2h, within 8h of the bounding box (h²/d next to smooth surfaces), and by at most 8h in the coarse grid (7h²/d).
    Beyond that, from about ``bounding_radius`` on, they are distances to the bounding box or ball. They change with the
    state no faster than it moves, but for these errors.

    Inside is what cannot be reached from far away through the gaps between triangles; gaps narrower than about h are
    closed. A mesh that is not watertight therefore keeps its inside if its holes are small. With large holes it has
    none: it is a shell, as thick as the error.

    Args:
        vertices: [m].
        faces: Three vertices each, by index; any orientation.
        velocity: Shape (3,) [m/s].
        cells: Grid steps along the longest side of the bounding box.

    Attributes:
        vertices: As given, shape (vertex, 3) [m].
        faces: As given, shape (face, 3).
        is_watertight: Whether every edge belongs to exactly two faces.
        is_shell: Whether it has no inside, or one that is thinner than about 4h; ``inradius`` is h then.
        error_m: How far a distance may lie below the true one at the surface [m].

    Raises:
        InvalidSetting: If there are no faces, vertices are not finite, the mesh has no extent, or cells are few.
        ShapeMismatch: If a face names a vertex that does not exist.
    """

    vertices: Tensor
    faces: Tensor
    low: Tensor
    high: Tensor

    def __init__(self, vertices: Points, faces: Faces, velocity: Tensor | None = None, cells: int = 64) -> None:
        _require_surface(vertices, faces, cells)
        vertices = np.asarray(vertices, dtype=np.float64)
        used = vertices[np.unique(faces)]
        low, high = used.min(axis=0), used.max(axis=0)
        step = float((high - low).max()) / cells
        surface = _Surface(vertices[faces], step)
        fine = Nodes(low, high, step, MARGIN * step)
        coarse = Nodes(low, high, COARSENESS * step, float(np.linalg.norm(high - low)) / 2)
        signed = surface.signed_distances(fine)
        deepest = float(signed.min())
        is_deep = (signed < deepest + step).ravel()
        middle = fine.points[is_deep][np.linalg.norm(fine.points[is_deep] - (low + high) / 2, axis=1).argmin()]
        super().__init__(torch.from_numpy(middle), velocity=velocity)
        self.is_shell = deepest > -NEAR * step
        known = -deepest - (1 + float(np.sqrt(3))) * step  # of a node that may be a step less deep
        self.inradius = step if self.is_shell else max(surface.depth(middle), known, step)
        self.bounding_radius = float(np.linalg.norm(used - middle, axis=1).max())
        self.is_watertight, self.error_m = open_edges(faces) == 0, 2 * step
        self.fine, self.coarse = Grid(fine, signed), Grid(coarse, surface.distances_beyond(coarse, low, high))
        self.register_buffer("vertices", torch.from_numpy(vertices))
        self.register_buffer("faces", torch.from_numpy(np.asarray(faces, dtype=np.int64)))
        self.register_buffer("low", torch.from_numpy(low))
        self.register_buffer("high", torch.from_numpy(high))

    def signed_distance(self, x: State) -> Float[Tensor, "*batch"]:
        points = x.reshape(-1, 3)
        to_box = length(torch.maximum(self.low - points, points - self.high).clamp(min=0))[:, 0]
        found = torch.maximum(to_box, length(points - self.reference)[:, 0] - self.bounding_radius)
        for grid in (self.coarse, self.fine):
            covered = grid.covers(points).nonzero()[:, 0]
            found = found.index_put((covered,), grid(points[covered]))
        return found.reshape(x.shape[:-1])


def open_edges(faces: Faces) -> int:
    """How many edges do not belong to exactly two faces."""
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    return int((counts != 2).sum())


def sample_surface(triangles: Float[np.ndarray, "face 3 3"], spacing_m: float) -> Points:
    """Points on triangles such that, within its face or edge, every point of the surface has one closer than that.

    A triangle cut into n² similar ones, whose corners are the samples, has none farther away than its longest
    side / (√3 n).
    """
    sides = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    cuts = np.maximum(np.ceil(sides / (np.sqrt(3) * spacing_m)), 1).astype(int)
    samples = []
    for n in np.unique(cuts):
        i, j = (index[np.add(*np.indices((n + 1, n + 1))) <= n] for index in np.indices((n + 1, n + 1)))
        weights = np.stack([i, j, n - i - j], axis=1) / n
        samples.append(np.einsum("sc,fcd->fsd", weights, triangles[cuts == n]).reshape(-1, 3))
    return np.concatenate(samples)


class _Surface:
    """Distances to samples of a surface: dense ones near it, sparse ones where that makes little difference."""

    def __init__(self, triangles: Float[np.ndarray, "face 3 3"], step: float) -> None:
        self.step = step
        self.dense = cKDTree(sample_surface(triangles, step * DENSE), leafsize=LEAF)
        self.sparse = cKDTree(sample_surface(triangles, SPARSE * step), leafsize=LEAF)

    def signed_distances(self, nodes: Nodes) -> Voxels:
        """Far inside, where faces may be that bound nothing, it is the distance to the nearest node outside."""
        distances, _ = self.dense.query(nodes.points, distance_upper_bound=NEAR * self.step)
        free = _less_gaps(distances, self.step * DENSE)
        is_outside = _outside(free.reshape(nodes.shape), self.step)
        depth = (self.step * distance_transform_edt(~is_outside)).ravel()
        depth = np.where(depth > NEAR * self.step, depth, np.minimum(distances, depth))
        is_far, is_outside = np.isinf(distances), is_outside.ravel()
        free[is_far & is_outside] = self.distances_afar(nodes.points[is_far & is_outside])
        return np.where(is_outside, free, -depth).reshape(nodes.shape)

    def distances_beyond(self, nodes: Nodes, low: Float[np.ndarray, " 3"], high: Float[np.ndarray, " 3"]) -> Voxels:
        """Zero within a box, which must contain the surface."""
        distances = np.zeros(len(nodes.points))
        is_beyond = ((nodes.points < low) | (nodes.points > high)).any(axis=1)
        distances[is_beyond] = self.distances_afar(nodes.points[is_beyond])
        return distances.reshape(nodes.shape)

    def distances_afar(self, points: Points) -> Float[np.ndarray, " point"]:
        return _less_gaps(self.sparse.query(points)[0], SPARSE * self.step)

    def depth(self, point: Float[np.ndarray, " 3"]) -> float:
        """Surely the distance of a point to the surface."""
        return float(self.dense.query(point)[0]) - self.step * DENSE


def _less_gaps(distances: Float[np.ndarray, " point"], spacing: float) -> Float[np.ndarray, " point"]:
    """Distances to a surface, at least, from those to samples within a spacing of each of its points."""
    return np.asarray(np.sqrt(np.maximum(distances**2 - spacing**2, 0)))


def _outside(free: Voxels, step: float) -> Bool[np.ndarray, "x y z"]:
    """Nodes connected with the first one, a corner of the grid, without crossing the surface.

    Two neighbours are, if the balls that are free around them touch.
    """
    index = np.arange(free.size).reshape(free.shape)
    pairs = []
    for offset in FORWARD:
        here, there = _overlap([-o for o in offset], free.shape), _overlap(offset, free.shape)
        is_free = free[here] + free[there] > step * float(np.linalg.norm(offset))
        pairs.append(np.stack([index[here][is_free], index[there][is_free]]))
    rows, columns = np.concatenate(pairs, axis=1)
    graph = coo_array((np.ones(len(rows), dtype=bool), (rows, columns)), shape=(index.size, index.size))
    _, labels = connected_components(graph, directed=False)
    return np.asarray((labels == labels[0]).reshape(free.shape))


def _overlap(offset: Sequence[int], shape: Sequence[int]) -> tuple[slice, ...]:
    """The part of an array that is left when it is shifted by an offset."""
    return tuple(slice(max(o, 0), n + min(o, 0)) for o, n in zip(offset, shape, strict=True))


def _require_surface(vertices: Points, faces: Faces, cells: int) -> None:
    if len(faces) == 0:
        raise InvalidSetting("mesh.faces", "none", "a triangle or more")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ShapeMismatch("vertices named by the faces of a mesh", f"0 to {len(vertices) - 1}", int(faces.max()))
    if not np.isfinite(vertices).all():
        raise InvalidSetting("mesh.vertices", "NaN or infinity", "finite coordinates")
    if not np.ptp(vertices[faces].reshape(-1, 3), axis=0).max() > 0:
        raise InvalidSetting("mesh.vertices", "all in one place", "a mesh with an extent")
    if cells < 8:
        raise InvalidSetting("mesh.cells", cells, "8 or more")
