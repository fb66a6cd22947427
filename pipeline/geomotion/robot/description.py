"""Robots as URDF files describe them, read by pytorch-kinematics' parser.

Its chains keep offsets in single precision, and turn a joint without an axis about z where the format says x. So the
numbers are taken from the parsed file, in double precision, and the chains serve the tests as reference.
"""

import io
from collections.abc import Iterator, Mapping
from contextlib import redirect_stderr
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from geomotion.errors import InvalidSetting, MissingData, UnknownName
from geomotion.types import Float

TURNING = ("revolute", "continuous")
DEFAULT_AXIS = (1.0, 0.0, 0.0)


@dataclass(frozen=True)
class Urdf:
    """A parsed URDF.

    Attributes:
        path: Where it was read; meshes are looked up relative to it.
        name: Of the robot.
        links: By name, as the parser made them.
        to_link: The joint that leads to each link but the root, as the parser made it, by the link's name.
    """

    path: Path
    name: str
    links: Mapping[str, Any]
    to_link: Mapping[str, Any]

    def joints_to_root(self, link: str) -> Iterator[Any]:
        """Joints from a link back to the root."""
        while link in self.to_link:
            yield self.to_link[link]
            link = self.to_link[link].parent

    def joints_between(self, base: str, tip: str) -> tuple[Any, ...]:
        """Joints from one link to another, fixed ones included.

        Raises:
            UnknownName: If there is no such link.
            InvalidSetting: If the tip is not carried by the base, no joint between them turns, or one is neither
                fixed nor turns freely.
        """
        for link in (base, tip):
            if link not in self.links:
                raise UnknownName(f"link of {self.path.name}", link, self.links)
        joints = []
        for joint in self.joints_to_root(tip):
            joints.append(joint)
            if joint.parent == base:
                break
        if not joints or joints[-1].parent != base:
            raise InvalidSetting("arm.base_link", base, f"a link from which joints lead to {tip!r}")
        for joint in joints:
            _require_serial(joint)
        if not any(joint.type in TURNING for joint in joints):
            raise InvalidSetting("arm.tip_link", tip, f"a link that a joint turns against {base!r}")
        return tuple(reversed(joints))


def read_urdf(path: Path) -> Urdf:
    """Read a URDF file.

    Raises:
        MissingData: If there is no such file.
        InvalidSetting: If it is no URDF, or its joints go in a circle.
    """
    if not path.is_file():
        raise MissingData(f"URDF {path}", "Name an existing file with arm.urdf=.")
    robot = _parsed(path)
    urdf = Urdf(path, robot.name or path.stem, robot.link_map, {joint.child: joint for joint in robot.joints})
    if not urdf.links:
        raise InvalidSetting("arm.urdf", path, "a URDF with links")
    for joint in robot.joints:
        if joint.parent not in urdf.links or joint.child not in urdf.links:
            raise InvalidSetting("arm.urdf", path, f"a URDF that has the links of its joint {joint.name!r}")
    for link in urdf.links:
        for count, _ in enumerate(urdf.joints_to_root(link)):
            if count > len(urdf.to_link):
                raise InvalidSetting("arm.urdf", path, f"a tree of links; that of {link!r} goes in a circle")
    return urdf


def placement(element: Any) -> Float[np.ndarray, "4 4"]:
    """The frame of a joint or shape in that of its parent [m]."""
    transform = np.eye(4)
    if element.origin is not None:
        transform[:3, :3] = Rotation.from_euler("xyz", element.origin.rpy or (0.0, 0.0, 0.0)).as_matrix()
        transform[:3, 3] = element.origin.xyz or (0.0, 0.0, 0.0)
    return transform


def axis_of(joint: Any) -> Float[np.ndarray, "3"]:
    """Unit vector about or along which a joint moves, in its own frame.

    Raises:
        InvalidSetting: If it has no direction.
    """
    axis = np.array(joint.axis or DEFAULT_AXIS, dtype=np.float64)
    length = float(np.linalg.norm(axis))
    if not 0 < length < np.inf:
        raise InvalidSetting("arm.urdf", f"joint {joint.name!r} with axis {axis.tolist()}", "an axis with a direction")
    return axis / length


def _parsed(path: Path) -> Any:
    from pytorch_kinematics.urdf_parser_py.urdf import URDF
    from pytorch_kinematics.urdf_parser_py.xml_reflection.core import ParseError

    try:
        root = ElementTree.fromstring(path.read_bytes())
        for irrelevant in [element for element in root if element.tag not in ("link", "joint", "material")]:
            root.remove(irrelevant)  # the parser knows few of the transmissions and plugins that there are
        with redirect_stderr(io.StringIO()):  # it names every tag that is not in its list
            return URDF.from_xml_string(ElementTree.tostring(root))
    except (ElementTree.ParseError, ParseError, AssertionError, ValueError) as error:
        reason = " ".join(str(error).split()).rstrip(".")
        raise InvalidSetting("arm.urdf", path, f"a URDF file; its reader says: {reason}") from error


def _require_serial(joint: Any) -> None:
    if joint.type not in (*TURNING, "fixed"):
        raise InvalidSetting(
            "arm.urdf", f"{joint.type} joint {joint.name!r}", "an arm of revolute, continuous and fixed joints"
        )
    if joint.mimic is not None:
        raise InvalidSetting(
            "arm.urdf", f"joint {joint.name!r}, which mimics another", "joints that move by themselves"
        )
