"""Closed surfaces of polygons and triangle meshes: what they enclose, and from where all of it can be seen."""

import numpy as np
import shapely
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, QhullError

from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.obstacles.mesh import open_edges
from geomotion.types import Float, Int

Points = Float[np.ndarray, "point D"]
FLAT = 1e-9  # of the size: nothing thinner has an inside
CONVEX = 1e-6  # of the volume: what a convex hull may add to a body that counts as convex


class Boundary:
    """A closed surface in the plane (edges) or in space (triangles), oriented outwards.

    Args:
        vertices: [m].
        simplices: The D vertices of each edge or triangle, by index; the same sense of rotation everywhere.

    Attributes:
        vertices: As given, shape (vertex, D) [m].
        simplices: Oriented outwards, shape (face, D).
        normals: Outward unit normals, shape (face, D).
        offsets: nᵀx of the points x of each face, shape (face,) [m].
        volume: What it encloses [m² or m³].

    Raises:
        InvalidSetting: If a number is not finite, or nothing is enclosed.
        ShapeMismatch: If these are neither edges in the plane nor triangles in space.
    """

    def __init__(self, vertices: Points, simplices: Int[np.ndarray, "face D"]) -> None:
        dim = vertices.shape[1]
        if dim not in (2, 3):
            raise ShapeMismatch("coordinates of the vertices of an obstacle", "2 or 3", dim)
        if not np.isfinite(vertices).all():
            raise InvalidSetting("obstacle vertices", "NaN or infinity", "finite coordinates")
        corners = vertices[simplices]
        volume = float(np.linalg.det(corners - vertices.mean(axis=0)).sum()) / (2 if dim == 2 else 6)
        size = float(np.ptp(vertices, axis=0).max())
        if abs(volume) <= FLAT * size**dim:
            raise InvalidSetting("obstacle vertices", f"an enclosed volume of {volume:.3g}", "a body with an inside")
        self.vertices, self.volume = vertices, abs(volume)
        self.simplices = simplices if volume > 0 else simplices[:, ::-1]
        across = _across(vertices[self.simplices])
        area = np.linalg.norm(across, axis=1, keepdims=True)
        self.simplices, across, area = (rows[area[:, 0] > 0] for rows in (self.simplices, across, area))
        self.normals = across / area
        self.offsets = np.einsum("fd,fd->f", self.normals, vertices[self.simplices[:, 0]])

    @classmethod
    def of_polygon(cls, vertices: Points) -> "Boundary":
        """Of corners in the order in which they are met on the way round.

        Raises:
            InvalidSetting: If there are fewer than three, or edges cross.
        """
        if len(vertices) < 3 or vertices.shape[1] != 2:
            raise InvalidSetting(
                "obstacle.vertices_m", vertices.tolist(), "three corners or more, two coordinates each"
            )
        if np.isfinite(vertices).all() and not shapely.Polygon(vertices).is_valid:
            reason = shapely.is_valid_reason(shapely.Polygon(vertices))
            raise InvalidSetting("obstacle.vertices_m", reason, "corners in order, so that no two edges cross or touch")
        index = np.arange(len(vertices))
        return cls(vertices, np.stack([index, np.roll(index, -1)], axis=1))

    @classmethod
    def of_mesh(cls, vertices: Points, faces: Int[np.ndarray, "face 3"]) -> "Boundary":
        """Of triangles that all turn the same way.

        Raises:
            InvalidSetting: If there are holes, or triangles turn different ways.
        """
        if gaps := open_edges(faces):
            expected = "a watertight mesh; close its holes, or avoid its convex hull with obstacle.convex_hull=true"
            raise InvalidSetting("obstacle.file", f"a mesh with {gaps} edges of other than two triangles", expected)
        directed = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        if len(np.unique(directed, axis=0)) < len(directed):
            raise InvalidSetting(
                "obstacle.file", "triangles that turn different ways", "consistently oriented triangles"
            )
        return cls(vertices, faces)

    @property
    def dim(self) -> int:
        """D."""
        return int(self.vertices.shape[1])

    @property
    def is_convex(self) -> bool:
        """Whether the convex hull encloses no more."""
        return bool(convex_hull(self.vertices).volume <= (1 + CONVEX) * self.volume)

    def samples(self, reference: Float[np.ndarray, " D"], angle: float) -> tuple[Points, Int[np.ndarray, " point"]]:
        """Points that cover the surface, and the face of each.

        A triangle cut into n² similar ones has no point farther from their corners than its longest side / (√3 n); on
        an edge cut into n, it is half of a part.

        Args:
            reference: A point on the inner side of every face.
            angle: Seen from there, within its face, every point of the surface has a sample closer than that [rad].
        """
        corners = self.vertices[self.simplices]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        nearest_corner = np.linalg.norm(corners - reference, axis=2).min(axis=1)
        away = np.maximum(self.offsets - self.normals @ reference, nearest_corner - longest)
        spacing = angle * away * (2 if self.dim == 2 else np.sqrt(3))
        cuts = np.ceil(longest / spacing).astype(int)
        found, owners = [], []
        for n in np.unique(cuts):
            faces = np.flatnonzero(cuts == n)
            steps = np.stack([index.ravel() for index in np.indices((n + 1,) * (self.dim - 1))], axis=1)
            steps = steps[steps.sum(axis=1) <= n]
            weights = np.column_stack([steps, n - steps.sum(axis=1)]) / n
            found.append((weights @ corners[faces]).reshape(-1, self.dim))
            owners.append(np.repeat(faces, len(weights)))
        return np.concatenate(found), np.concatenate(owners)


def deepest_point(
    normals: Float[np.ndarray, "face D"], offsets: Float[np.ndarray, " face"]
) -> tuple[Float[np.ndarray, " D"], float]:
    """The point that lies deepest behind all of the planes nᵀx = b, and how deep [m]; not above zero where none does.

    Of the faces of a body, it is its Chebyshev centre if the body is convex, and that of its kernel, the points from
    which all of the surface can be seen, if it is star-shaped.
    """
    rows = np.column_stack([normals, np.ones(len(normals))])
    solution = linprog(-np.eye(rows.shape[1])[-1], A_ub=rows, b_ub=offsets, bounds=(None, None))
    return np.asarray(solution.x[:-1]), float(solution.x[-1])


def convex_hull(vertices: Points) -> ConvexHull:
    """Of points that do not all lie in one plane.

    Raises:
        InvalidSetting: If they do.
    """
    try:
        return ConvexHull(vertices)
    except QhullError as error:
        raise InvalidSetting("obstacle vertices", "all in one plane or line", "a body with an inside") from error


def _across(corners: Float[np.ndarray, "face D D"]) -> Float[np.ndarray, "face D"]:
    """Outward normals as long as the faces are large."""
    if corners.shape[1] == 2:
        along = corners[:, 1] - corners[:, 0]
        return np.stack([along[:, 1], -along[:, 0]], axis=1)
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
