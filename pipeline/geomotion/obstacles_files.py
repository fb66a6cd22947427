"""Obstacles from files: meshes and point clouds."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial.transform import Rotation

from geomotion.errors import DatasetError, InvalidSetting, MissingData
from geomotion.obstacles.mesh import Mesh, open_edges
from geomotion.obstacles.point_cloud import PointCloud

log = logging.getLogger("geomotion")

Points = Float[np.ndarray, "point 3"]


@dataclass(frozen=True)
class Placement:
    """Where the points of a file are: scaled, then turned about its origin, then moved.

    Attributes:
        scale: Metres in a unit of the file.
        rotation_rad: Rotation vector.
        translation_m: Where the file's origin is.

    Raises:
        InvalidSetting: If the scale is not positive, or a number is not finite.
    """

    scale: float = 1.0
    rotation_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)
    translation_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not (self.scale > 0 and np.isfinite(self.scale)):
            raise InvalidSetting("placement.scale", self.scale, "a finite number above 0, metres in a unit of the file")
        if not np.isfinite([*self.rotation_rad, *self.translation_m]).all():
            found = (self.rotation_rad, self.translation_m)
            raise InvalidSetting("placement.rotation_rad, translation_m", found, "finite numbers")

    def apply(self, points: Points) -> Points:
        """Points of the file in the robot's frame [m]."""
        turned = Rotation.from_rotvec(self.rotation_rad).apply(self.scale * points)
        return np.asarray(turned + np.array(self.translation_m))


AS_IT_IS = Placement()


def load_mesh(path: Path, placement: Placement = AS_IT_IS, cells: int = 64) -> Mesh:
    """A mesh from an .obj, .stl or .ply file; one that is not watertight is named in a warning.

    Args:
        path: Of the file.
        placement: Where it is.
        cells: Grid steps along its longest side, as in :class:`geomotion.obstacles.mesh.Mesh`.

    Raises:
        MissingData: If there is no such file.
        InvalidSetting: If its suffix names another format.
        DatasetError: If it cannot be read, has no faces, or a vertex is not finite.
    """
    vertices, faces = load_triangles(path)
    mesh = Mesh(placement.apply(vertices), faces, cells=cells)
    if not mesh.is_watertight:
        _warn_of_holes(path, mesh, open_edges(faces))
    return mesh


def load_triangles(path: Path) -> tuple[Points, Int[np.ndarray, "face 3"]]:
    """Vertices and faces of an .obj, .stl or .ply file, as they are there but for corners that are repeated.

    Raises:
        MissingData: If there is no such file.
        InvalidSetting: If its suffix names another format.
        DatasetError: If it cannot be read, has no faces, or a vertex is not finite.
    """
    _require_file(path, "mesh", MESH_SUFFIXES)
    loaded = _with_trimesh(path, force="mesh")
    faces = np.asarray(getattr(loaded, "faces", np.zeros((0, 3))), dtype=np.int64)
    if len(faces) == 0:
        raise DatasetError(path, "has no faces; load it as a point cloud, or export it with triangles")
    vertices = _finite(path, np.asarray(loaded.vertices, dtype=np.float64))
    vertices, merged = np.unique(vertices, axis=0, return_inverse=True)  # STL repeats corners, OBJ seams of textures
    faces = merged[faces]
    return vertices, faces[_is_triangle(faces)]


def load_point_cloud(path: Path, radius_m: float, placement: Placement = AS_IT_IS) -> PointCloud:
    """A point cloud from a .npy, .npz, .csv, .xyz or .ply file, the first three columns of which are coordinates.

    Args:
        path: Of the file; a .npz holds one array, or one named ``points``.
        radius_m: Of the ball around each point.
        placement: Where the points are.

    Raises:
        MissingData: If there is no such file.
        InvalidSetting: If its suffix names another format, or the radius is not positive.
        DatasetError: If it cannot be read, is empty, or a point is not finite.
    """
    _require_file(path, "point cloud", tuple(CLOUD_READERS))
    points = CLOUD_READERS[path.suffix.lower()](path)
    if points.size == 0:
        raise DatasetError(path, "holds no points; expected one or more rows of x, y, z")
    if points.ndim != 2 or points.shape[1] < 3:
        raise DatasetError(path, f"holds an array of shape {points.shape}; expected (point, 3)")
    return PointCloud(placement.apply(_finite(path, points[:, :3])), radius_m)


def _read_array(path: Path) -> np.ndarray:
    try:
        loaded = np.load(path, allow_pickle=False)
        if isinstance(loaded, np.lib.npyio.NpzFile):
            names = ["points"] if "points" in loaded.files else loaded.files
            if len(names) != 1:
                raise DatasetError(path, f"holds the arrays {', '.join(names)}; expected one, or one named points")
            loaded = loaded[names[0]]
        return np.asarray(loaded, dtype=np.float64)
    except (OSError, ValueError, EOFError) as error:
        raise DatasetError(path, "not an array of numbers, or truncated") from error


def _read_text(path: Path) -> np.ndarray:
    """Rows of numbers between commas or blanks; a first row that is none names the columns."""
    rows = path.read_text(encoding="utf-8", errors="replace").replace(",", " ").splitlines()
    rows = [row for row in rows if row.strip() and not row.lstrip().startswith("#")]
    if rows and not _is_number(rows[0].split()[0]):
        rows = rows[1:]
    try:
        return np.array([[float(word) for word in row.split()[:3]] for row in rows])
    except ValueError as error:
        raise DatasetError(path, f"has a row that is not three numbers: {error}") from error


def _read_ply(path: Path) -> np.ndarray:
    return np.asarray(_with_trimesh(path).vertices, dtype=np.float64)


MESH_SUFFIXES = (".obj", ".stl", ".ply")
CLOUD_READERS: dict[str, Callable[[Path], np.ndarray]] = {
    ".npy": _read_array,
    ".npz": _read_array,
    ".csv": _read_text,
    ".xyz": _read_text,
    ".ply": _read_ply,
}


def _with_trimesh(path: Path, **options: Any) -> Any:
    import trimesh

    try:
        return trimesh.load(path, process=False, **options)
    except Exception as error:  # each of its readers fails in its own way on a damaged file
        raise DatasetError(path, f"cannot be read as {path.suffix.lower()}: {error or type(error).__name__}") from error


def _require_file(path: Path, what: str, suffixes: tuple[str, ...]) -> None:
    if path.suffix.lower() not in suffixes:
        raise InvalidSetting("file", path, f"a {what} as {', '.join(suffixes)}")
    if not path.is_file():
        raise MissingData(f"{path} ({what})", "Check the path; it is relative to where the command was started.")


def _finite(path: Path, points: Points) -> Points:
    broken = int((~np.isfinite(points)).any(axis=1).sum())
    if broken:
        raise DatasetError(path, f"{broken} of {len(points)} points are NaN or infinite; remove them")
    return points


def _is_triangle(faces: np.ndarray) -> np.ndarray:
    a, b, c = faces.T
    return np.asarray((a != b) & (b != c) & (c != a))


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _warn_of_holes(path: Path, mesh: Mesh, count: int) -> None:
    meaning = (
        "it has no inside and counts as a thin shell, so a motion can start within it"
        if mesh.is_shell
        else f"its holes are narrower than about {1000 * mesh.error_m / 2:.2g} mm or lead nowhere, so it has an inside"
    )
    log.warning("%s is not watertight: %d edges do not belong to exactly two faces; %s.", path, count, meaning)
