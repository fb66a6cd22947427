"""Kinematics of a chain of revolute joints, read from a URDF: poses and geometric Jacobians, in batches.

Independent of the simulator, so that asking where the arm would be never disturbs where it is.
"""

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from geomotion.errors import ShapeMismatch
from geomotion.robot import panda
from geomotion.types import Float

Joints = Float[np.ndarray, "*batch joint"]
Positions = Float[np.ndarray, "*batch 3"]
Quaternions = Float[np.ndarray, "*batch 4"]


@dataclass(frozen=True)
class Chain:
    """Revolute joints in a row, from the base to a frame.

    Attributes:
        before: Pose of each joint in the frame of the one before, shape (joint, 4, 4) [m].
        axes: Unit vector of each joint in its own frame, shape (joint, 3).
        tip: Pose of the chain's end in the last joint's frame, shape (4, 4) [m].
    """

    before: Float[np.ndarray, "joint 4 4"]
    axes: Float[np.ndarray, "joint 3"]
    tip: Float[np.ndarray, "4 4"]

    def pose(self, joints_rad: Joints) -> tuple[Positions, Quaternions]:
        """Position [m] and orientation (wxyz, w ≥ 0) of the tip in the base frame.

        Raises:
            ShapeMismatch: If there is not one angle per joint.
        """
        transform = self._transforms(joints_rad)[-1]
        quaternions = Rotation.from_matrix(transform[..., :3, :3].reshape(-1, 3, 3)).as_quat(
            canonical=True, scalar_first=True
        )
        return transform[..., :3, 3], quaternions.reshape(*transform.shape[:-2], 4)

    def pose_and_jacobian(
        self, joints_rad: Float[np.ndarray, " joint"]
    ) -> tuple[Float[np.ndarray, "4 4"], Float[np.ndarray, "6 joint"]]:
        """The tip's transform [m] and the Jacobian of its velocity [m/rad] and angular velocity in the base frame."""
        *joints, tip = self._transforms(joints_rad)
        frames = np.stack(joints)
        axes = (frames[:, :3, :3] @ self.axes[:, :, None])[:, :, 0]
        lever = tip[:3, 3] - frames[:, :3, 3]
        return tip, np.concatenate([_cross(axes, lever).T, axes.T])

    def _transforms(self, joints_rad: Joints) -> list[Float[np.ndarray, "*batch 4 4"]]:
        """Poses of all joints, each turned by its angle, and of the tip."""
        count = len(self.axes)
        if joints_rad.shape[-1:] != (count,):
            raise ShapeMismatch("joint positions", f"(..., {count})", joints_rad.shape)
        turned = self.before @ _turns(self.axes, joints_rad)
        frames = [turned[..., 0, :, :]]
        for index in range(1, count):
            frames.append(frames[-1] @ turned[..., index, :, :])
        return [*frames, frames[-1] @ self.tip]


def _cross(a: Float[np.ndarray, "n 3"], b: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Written out: numpy's takes as long as the rest of the Jacobian."""
    x, y, z = a.T
    u, v, w = b.T
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=1)


def _turns(axes: Float[np.ndarray, "joint 3"], angles_rad: Joints) -> Float[np.ndarray, "*batch joint 4 4"]:
    """Rotations about unit axes by Rodrigues' formula, as homogeneous transforms."""
    x, y, z = axes.T
    zero = np.zeros_like(x)
    skew = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(-1, 3, 3)
    sine, cosine = np.sin(angles_rad)[..., None, None], np.cos(angles_rad)[..., None, None]
    turns = np.zeros((*angles_rad.shape, 4, 4))
    turns[..., 3, 3] = 1
    turns[..., :3, :3] = np.eye(3) + sine * skew + (1 - cosine) * (skew @ skew)
    return turns


@functools.cache
def panda_chain(frame: panda.Frame) -> Chain:
    """The Panda from its base to one of its frames."""
    return read_chain(panda.urdf_path(), panda.BASE_LINK, panda.FRAME_LINKS[frame])


def read_chain(path: Path, base: str, tip: str) -> Chain:
    """The chain between two links of a URDF; fixed joints are merged into their neighbours."""
    before, axes, fixed = [], [], np.eye(4)
    for joint in _joints_between(path, base, tip):
        fixed = fixed @ _origin(joint)
        if joint.get("type") != "fixed":
            before.append(fixed)
            axes.append(_numbers(joint.find("axis"), "xyz", (1.0, 0.0, 0.0)))
            fixed = np.eye(4)
    return Chain(np.stack(before), np.stack(axes), fixed)


def _joints_between(path: Path, base: str, tip: str) -> Iterator[ElementTree.Element]:
    to_link = {_link(joint, "child"): joint for joint in ElementTree.parse(path).iter("joint")}
    joints, link = [], tip
    while link != base:
        joints.append(to_link[link])
        link = _link(joints[-1], "parent")
    return reversed(joints)


def _link(joint: ElementTree.Element, side: str) -> str:
    element = joint.find(side)
    return "" if element is None else element.get("link", "")


def _origin(joint: ElementTree.Element) -> Float[np.ndarray, "4 4"]:
    element = joint.find("origin")
    transform = np.eye(4)
    transform[:3, :3] = Rotation.from_euler("xyz", _numbers(element, "rpy", (0.0, 0.0, 0.0))).as_matrix()
    transform[:3, 3] = _numbers(element, "xyz", (0.0, 0.0, 0.0))
    return transform


def _numbers(
    element: ElementTree.Element | None, attribute: str, default: tuple[float, ...]
) -> Float[np.ndarray, " axis"]:
    text = None if element is None else element.get(attribute)
    return np.array(default if text is None else [float(word) for word in text.split()])
