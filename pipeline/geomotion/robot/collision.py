"""Collision shapes of a URDF's links, as corners of convex bodies that contain them.

Simulators treat a collision mesh as its convex hull; so does this.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from geomotion.errors import InvalidSetting, MissingData
from geomotion.robot.description import TURNING, Urdf, axis_of, placement
from geomotion.types import Float

SIDES = 32  # of the prism around a cylinder
SPHERE_SUBDIVISIONS = 2  # of the icosahedron around a sphere
CUBE = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])

Transform = Float[np.ndarray, "4 4"]
Corners = Float[np.ndarray, "corner 3"]


@dataclass(frozen=True)
class LinkShape:
    """One collision shape of a link that moves.

    Attributes:
        link: Name of the link.
        frame: Index of the joint whose frame it moves with.
        placement: The shape's own frame in that frame [m].
        geometry: As the URDF's parser made it.
        folder: Where the URDF is, and its meshes with it.
    """

    link: str
    frame: int
    placement: Transform
    geometry: Any
    folder: Path

    def corners_m(self) -> Corners:
        """Points whose convex hull contains the shape, in the joint's frame [m].

        Raises:
            MissingData: If a mesh is not there.
            InvalidSetting: If it cannot be read.
        """
        corners: Corners = _corners(self) @ self.placement[:3, :3].T + self.placement[:3, 3]
        return corners


def link_shapes(urdf: Urdf, joints: Iterable[Any]) -> tuple[LinkShape, ...]:
    """Collision shapes of all links that some joints carry, also of those beside the chain or beyond its tip.

    Joints that are not among them rest.
    """
    frames = {joint.name: index for index, joint in enumerate(one for one in joints if one.type in TURNING)}
    return tuple(_shapes(urdf, frames))


def resting_positions(urdf: Urdf) -> dict[str, float]:
    """Where the joints of a URDF are while nothing moves them [m or rad].

    Sliding ones, such as fingers, are at their upper limit, which is where grippers are open, turning ones at zero, or
    at the limit nearest to it; one that mimics another is where that one puts it.
    """
    joints = {joint.name: joint for joint in urdf.to_link.values() if joint.type in (*TURNING, "prismatic")}
    alone = {name: _resting(joint) for name, joint in joints.items()}
    return {name: _mimicked(joint, alone) for name, joint in joints.items()}


def root_in_link(urdf: Urdf, link: str, positions: Mapping[str, float]) -> Transform:
    """The frame of the root in that of a link [m].

    Args:
        urdf: Whose links they are.
        link: Name of the link.
        positions: Of the joints in between [m or rad].
    """
    in_root = np.eye(4)
    for joint in urdf.joints_to_root(link):
        in_root = placement(joint) @ _moved(joint, positions) @ in_root
    inverse: Transform = np.linalg.inv(in_root)
    return inverse


def _shapes(urdf: Urdf, frames: dict[str, int]) -> Iterator[LinkShape]:
    resting = resting_positions(urdf)
    for name, link in urdf.links.items():
        in_frame = np.eye(4)
        for joint in urdf.joints_to_root(name):
            if joint.name in frames:
                for shape in link.collisions:
                    at = in_frame @ placement(shape)
                    yield LinkShape(name, frames[joint.name], at, shape.geometry, urdf.path.parent)
                break
            in_frame = placement(joint) @ _moved(joint, resting) @ in_frame


def _resting(joint: Any) -> float:
    if joint.limit is None or joint.type == "continuous":
        return 0.0
    lower, upper = float(joint.limit.lower or 0.0), float(joint.limit.upper or 0.0)
    return upper if joint.type == "prismatic" else min(max(0.0, lower), upper)


def _mimicked(joint: Any, alone: Mapping[str, float]) -> float:
    mimic = joint.mimic
    if mimic is None:
        return alone[joint.name]
    factor = 1.0 if mimic.multiplier is None else float(mimic.multiplier)
    return factor * alone.get(mimic.joint, 0.0) + float(mimic.offset or 0.0)


def _moved(joint: Any, positions: Mapping[str, float]) -> Transform:
    """What the position of a joint adds to its placement."""
    moved = np.eye(4)
    if joint.type == "prismatic":
        moved[:3, 3] = positions[joint.name] * axis_of(joint)
    elif joint.type in TURNING:
        moved[:3, :3] = Rotation.from_rotvec(positions[joint.name] * axis_of(joint)).as_matrix()
    return moved


def _corners(shape: LinkShape) -> Corners:
    """In the shape's own frame."""
    geometry = shape.geometry
    corners: Corners
    match type(geometry).__name__:
        case "Mesh":
            corners = _hull(_mesh_path(geometry.filename, shape)) * np.array(geometry.scale or (1.0, 1.0, 1.0))
        case "Box":
            corners = CUBE * np.array(geometry.size) / 2
        case "Cylinder":
            angles = 2 * np.pi * np.arange(SIDES) / SIDES
            ring = float(geometry.radius) / np.cos(np.pi / SIDES) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
            corners = np.concatenate([np.insert(ring, 2, end * float(geometry.length) / 2, axis=1) for end in (-1, 1)])
        case "Sphere":
            corners = float(geometry.radius) * _around_unit_sphere()
        case kind:
            raise InvalidSetting("arm.urdf", f"link {shape.link!r} with a {kind}", "boxes, cylinders, spheres, meshes")
    return corners


def _around_unit_sphere() -> Corners:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=SPHERE_SUBDIVISIONS)
    inside = np.einsum("ij,ij->i", ball.face_normals, ball.triangles[:, 0]).min()
    corners: Corners = np.asarray(ball.vertices) / inside
    return corners


def _mesh_path(filename: str, shape: LinkShape) -> Path:
    """Where a mesh is: its path, without the scheme, from the URDF's folder or one above; packages are folders."""
    name = PurePosixPath(filename.split("://", 1)[-1])
    for folder in (shape.folder, *shape.folder.resolve().parents):
        for rest in (name, PurePosixPath(*name.parts[1:])):
            if (folder / rest).is_file():
                return folder / rest
    raise MissingData(f"mesh {filename!r} of link {shape.link!r}", f"Put it where the URDF in {shape.folder} says.")


def _hull(path: Path) -> Corners:
    import trimesh

    try:
        mesh = trimesh.load_mesh(path)
        corners: Corners = np.asarray(mesh.convex_hull.vertices, dtype=np.float64)
    except Exception as error:  # whatever a format's reader raises
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InvalidSetting("arm.urdf", path, f"a mesh that trimesh can read ({reason})") from error
    return corners
