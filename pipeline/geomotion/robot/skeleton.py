"""A body of bones and joints that branch: where its nodes are, for joint positions by name.

Read from the robot XML of Simox, in which the Master Motor Map describes the human body.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from geomotion.errors import DatasetError
from geomotion.xml_files import read_xml

METRES_PER = {"mm": 0.001, "cm": 0.01, "m": 1.0}
RADIANS_PER = {"radian": 1.0, "rad": 1.0, "degree": np.pi / 180, "deg": np.pi / 180}
TURNING, SLIDING, FIXED = "revolute", "prismatic", "fixed"
SHORTEST_BONE_M = 0.05  # of what is drawn: joints that share a place, and those of fingers, have shorter ones


@dataclass(frozen=True)
class Node:
    """A joint with its place on the node that carries it.

    Attributes:
        name: Of the joint.
        parent: Number of the node that carries it, smaller than its own; -1 for the root.
        place: Its frame in that of the parent at position 0, a 4 x 4 matrix [m].
        kind: ``revolute``, ``prismatic`` or ``fixed``.
        axis: Unit vector that it turns about, or slides along.
    """

    name: str
    parent: int
    place: tuple[tuple[float, ...], ...]
    kind: str
    axis: tuple[float, ...]


@dataclass(frozen=True)
class Skeleton:
    """Nodes, each after the one that carries it."""

    nodes: tuple[Node, ...]

    def positions(
        self,
        joints_rad: Float[np.ndarray, "time joint"],
        joint_names: Sequence[str],
        root_m: Float[np.ndarray, "time 3"],
        root_wxyz: Float[np.ndarray, "time 4"],
    ) -> Float[np.ndarray, "time node 3"]:
        """Where the nodes are [m].

        Args:
            joints_rad: Positions of joints; all others are at 0.
            joint_names: Of its columns; names that the skeleton lacks have no effect.
            root_m: Where the root stands [m].
            root_wxyz: How it is turned.
        """
        columns = {name: joints_rad[:, number] for number, name in enumerate(joint_names)}
        frames = np.empty((len(joints_rad), len(self.nodes), 4, 4))
        root = np.tile(np.eye(4), (len(joints_rad), 1, 1))
        root[:, :3, :3] = Rotation.from_quat(root_wxyz, scalar_first=True).as_matrix()
        root[:, :3, 3] = root_m
        for number, node in enumerate(self.nodes):
            carrier = root if node.parent < 0 else frames[:, node.parent]
            frames[:, number] = carrier @ np.array(node.place)
            if node.name in columns and node.kind != FIXED:
                frames[:, number] @= _moved(node, columns[node.name])
        return np.asarray(frames[:, :, :3, 3])

    def bones(self) -> list[tuple[int, int]]:
        """Pairs of nodes that a picture joins by a line: each node with a length, and the one that carries it."""
        lengths = [float(np.linalg.norm(np.array(node.place)[:3, 3])) for node in self.nodes]
        return [
            (node.parent, number)
            for number, node in enumerate(self.nodes)
            if node.parent >= 0 and lengths[number] >= SHORTEST_BONE_M
        ]

    def known(self, joint_names: Sequence[str]) -> list[str]:
        """Those of the names that are joints here, which move something."""
        names = {node.name for node in self.nodes if node.kind != FIXED}
        return [name for name in joint_names if name in names]

    def document(self) -> list[dict[str, Any]]:
        """Everything that it takes to make it again, as JSON types."""
        return [
            {"name": node.name, "parent": node.parent, "place": node.place, "kind": node.kind, "axis": node.axis}
            for node in self.nodes
        ]

    @classmethod
    def from_document(cls, document: Sequence[Mapping[str, Any]]) -> "Skeleton":
        """What :meth:`document` describes."""
        return cls(
            tuple(
                Node(one["name"], one["parent"], tuple(map(tuple, one["place"])), one["kind"], tuple(one["axis"]))
                for one in document
            )
        )


def read_simox(path: Path, scale: float = 1.0) -> Skeleton:
    """Nodes of a robot that Simox describes.

    Args:
        path: Its XML file.
        scale: Factor of all lengths; the human body of the Master Motor Map is for a height of 1 m.

    Raises:
        MissingData: If there is no such file.
        DatasetError: If it is no such file, or its nodes are not one tree; names the node.
    """
    document = read_xml(path)
    if document.tag.lower() != "robot":
        raise DatasetError(path, f"not a robot of Simox: it begins with <{document.tag}>; expected <Robot>")
    elements = {element.get("name", ""): element for element in _all(document, "robotnode")}
    root = document.get("RootNode") or document.get("rootnode") or ""
    if root not in elements:
        raise DatasetError(path, f"its root {root!r} is none of its {len(elements)} nodes")
    nodes: list[Node] = []
    waiting = [(root, -1)]
    while waiting:
        name, parent = waiting.pop()
        if name not in elements:
            raise DatasetError(path, f"node {nodes[parent].name!r} has the child {name!r}, which is not described")
        if any(node.name == name for node in nodes):
            raise DatasetError(path, f"node {name!r} is carried by two others")
        nodes.append(_node(elements[name], name, parent, path, scale))
        children = [child.get("name", "") for child in _all(elements[name], "child")]
        waiting += [(child, len(nodes) - 1) for child in reversed(children)]
    return Skeleton(tuple(nodes))


def _node(element: Element, name: str, parent: int, path: Path, scale: float) -> Node:
    place = np.eye(4)
    for part in (part for transform in _all(element, "transform") for part in transform):
        place = place @ _transform(part, path, name)
    place[:3, 3] *= scale
    joint = next(_all(element, "joint"), None)
    kind = FIXED if joint is None else (joint.get("type") or FIXED).lower()
    if kind not in (TURNING, "continuous", SLIDING, FIXED):
        raise DatasetError(path, f"node {name!r} has a joint of type {kind!r}; expected revolute, prismatic or fixed")
    axis = np.array([0.0, 0.0, 1.0])
    tag = "translationdirection" if kind == SLIDING else "axis"
    if joint is not None and (given := next(_all(joint, tag), None)) is not None:
        axis = _vector(given, "xyz", path, name)
        length = float(np.linalg.norm(axis))
        if length == 0:
            raise DatasetError(path, f"node {name!r} has an axis without a direction")
        axis = axis / length
    return Node(
        name, parent, tuple(map(tuple, place.tolist())), TURNING if kind == "continuous" else kind, tuple(axis.tolist())
    )


def _transform(element: Element, path: Path, name: str) -> Float[np.ndarray, "4 4"]:
    tag = element.tag.lower()
    matrix = np.eye(4)
    if tag == "matrix4x4":
        rows = [_vector(row, ("c1", "c2", "c3", "c4"), path, name) for row in element]
        if len(rows) != 4:
            raise DatasetError(path, f"node {name!r}: a matrix of {len(rows)} rows; expected 4")
        matrix = np.stack(rows)
        matrix[:3, 3] *= _factor(element, METRES_PER, "mm", path, name)
    elif tag == "translation":
        matrix[:3, 3] = _factor(element, METRES_PER, "mm", path, name) * _vector(element, "xyz", path, name)
    elif tag == "rollpitchyaw":
        angles = _vector(element, ("roll", "pitch", "yaw"), path, name)
        turned = Rotation.from_euler("xyz", _factor(element, RADIANS_PER, "radian", path, name) * angles)
        matrix[:3, :3] = turned.as_matrix()
    else:
        raise DatasetError(
            path, f"node {name!r} is placed by <{element.tag}>; expected <Matrix4x4>, <Translation> or <RollPitchYaw>"
        )
    return matrix


def _factor(element: Element, known: Mapping[str, float], usual: str, path: Path, name: str) -> float:
    unit = element.get("units") or element.get("unit") or element.get("unitsLength") or usual
    if unit not in known:
        raise DatasetError(path, f"node {name!r}: unknown unit {unit!r}; expected one of {', '.join(known)}")
    return known[unit]


def _vector(element: Element, keys: Sequence[str], path: Path, name: str) -> Float[np.ndarray, " _"]:
    try:
        values = np.array([float(element.attrib[key]) for key in keys])
    except (KeyError, ValueError) as error:
        raise DatasetError(path, f"node {name!r}: <{element.tag}> needs numbers {', '.join(keys)} ({error})") from error
    if not np.isfinite(values).all():
        raise DatasetError(path, f"node {name!r}: <{element.tag}> has numbers that are not finite")
    return values


def _moved(node: Node, positions: Float[np.ndarray, " time"]) -> Float[np.ndarray, "time 4 4"]:
    moved = np.tile(np.eye(4), (len(positions), 1, 1))
    if node.kind == TURNING:
        moved[:, :3, :3] = Rotation.from_rotvec(positions[:, None] * np.array(node.axis)).as_matrix()
    else:
        moved[:, :3, 3] = positions[:, None] * np.array(node.axis)
    return moved


def _all(element: Element, tag: str) -> Iterator[Element]:
    return (child for child in element if child.tag.lower() == tag)
