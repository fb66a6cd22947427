"""Kinematics of a chain of revolute joints, read from a URDF: poses, geometric Jacobians and body points, in batches.

Independent of the simulator, so that asking where the arm would be never disturbs where it is.
"""

import functools
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from geomotion.errors import ShapeMismatch
from geomotion.robot import panda
from geomotion.robot.body import BodyPoints
from geomotion.robot.description import axis_of, placement, read_urdf
from geomotion.types import Float

AT_ONCE = 2048  # configurations whose intermediate results stay in a core's cache

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
        frames = self.frames(joints_rad)
        return frames[-1], self.jacobian(frames, frames[-1, :3, 3])

    def frames(self, joints_rad: Joints) -> Float[np.ndarray, "frame *batch 4 4"]:
        """Poses of all joints, each turned by its angle, and of the tip, in the base frame [m]."""
        return np.stack(self._transforms(joints_rad))

    def jacobian(
        self, frames: Float[np.ndarray, "frame 4 4"], point_m: Float[np.ndarray, "3"]
    ) -> Float[np.ndarray, "6 joint"]:
        """Jacobian of the velocity [m/rad] of a point that moves with the tip, and of the tip's angular velocity."""
        axes = (frames[:-1, :3, :3] @ self.axes[:, :, None])[:, :, 0]
        return np.concatenate([_cross(axes, point_m - frames[:-1, :3, 3]).T, axes.T])

    def points(self, joints_rad: Joints, body: BodyPoints) -> Float[np.ndarray, "*batch point 3"]:
        """Where points of the body are, in the base frame [m].

        Raises:
            ShapeMismatch: If there is not one angle per joint.
        """
        self._require_angles(joints_rad)
        angles = joints_rad.reshape(-1, len(self.axes))
        found = np.empty((len(angles), len(body), 3))
        for start in range(0, len(angles), AT_ONCE):
            rows = slice(start, start + AT_ONCE)
            found[rows] = self._points(angles[rows].T, body).transpose(2, 0, 1)
        return found.reshape(*joints_rad.shape[:-1], len(body), 3)

    def reach_m(self, body: BodyPoints) -> Float[np.ndarray, "joint point"]:
        """How far a point can be from the axis of a joint at most, whatever the configuration [m].

        So for all q, q': ‖p(q) − p(q')‖ ≤ Σ reach |q − q'|. It is the sum of the lengths of the links in between, the
        first one measured across the axis; zero for joints that do not move the point.
        """
        links = self.before[1:, :3, 3]
        behind = np.concatenate([[0.0], np.linalg.norm(links, axis=1).cumsum()])  # from the first joint to each one
        across = np.append(np.linalg.norm(np.cross(links, self.axes[:-1]), axis=1), 0.0)
        first_link = across - np.append(np.diff(behind), 0.0)  # what measuring it across the axis adds
        joint, last = np.arange(len(self.axes))[:, None], body.frame
        further = first_link[:, None] + (behind[last] - behind[:, None]) + np.linalg.norm(body.offset_m, axis=1)
        own = np.linalg.norm(np.cross(body.offset_m, self.axes[last]), axis=1)
        reach: Float[np.ndarray, "joint point"] = np.where(joint < last, further, np.where(joint == last, own, 0.0))
        return reach

    @functools.cached_property
    def about_z(self) -> tuple[Float[np.ndarray, "joint 4 4"], Float[np.ndarray, "joint 3 3"]]:
        """`before` of the same chain in frames that turn about their own z axes, and the way to them.

        The second are rotations by which coordinates in the joints' own frames become such in those.
        """
        to_joint = np.stack([_z_to(axis) for axis in self.axes])
        before = self.before.copy()
        before[:, :3, :3] = before[:, :3, :3] @ to_joint
        before[1:, :3] = np.swapaxes(to_joint[:-1], 1, 2) @ before[1:, :3]
        return before, np.swapaxes(to_joint, 1, 2)

    def _points(self, angles_rad: Float[np.ndarray, "joint n"], body: BodyPoints) -> Float[np.ndarray, "point 3 n"]:
        """With configurations last, all arithmetic runs over long rows."""
        before, to_frame = self.about_z
        sine, cosine = np.sin(angles_rad), np.cos(angles_rad)
        count = angles_rad.shape[1]
        found = np.empty((len(body), 3, count))
        origin = np.zeros((3 * count,))
        axes = np.repeat(np.eye(3).ravel(), count).reshape(3, -1)  # x, y and z axis, of all configurations
        for joint, fixed in enumerate(before):
            origin = origin + fixed[:3, 3] @ axes
            x, y, z = (fixed[:3, :3].T @ axes).reshape(3, 3, count)
            axes = np.stack([cosine[joint] * x + sine[joint] * y, cosine[joint] * y - sine[joint] * x, z])
            axes = axes.reshape(3, -1)
            mine = body.frame == joint
            found[mine] = (origin + body.offset_m[mine] @ to_frame[joint].T @ axes).reshape(-1, 3, count)
        return found

    def _require_angles(self, joints_rad: Joints) -> None:
        if joints_rad.shape[-1:] != self.axes.shape[:1]:
            raise ShapeMismatch("joint positions", f"(..., {len(self.axes)})", joints_rad.shape)

    def _transforms(self, joints_rad: Joints) -> list[Float[np.ndarray, "*batch 4 4"]]:
        """Poses of all joints, each turned by its angle, and of the tip."""
        self._require_angles(joints_rad)
        turned = self.before @ _turns(self.axes, joints_rad)
        frames = [turned[..., 0, :, :]]
        for index in range(1, len(self.axes)):
            frames.append(frames[-1] @ turned[..., index, :, :])
        return [*frames, frames[-1] @ self.tip]


def _cross(a: Float[np.ndarray, "n 3"], b: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Written out: numpy's takes as long as the rest of the Jacobian."""
    x, y, z = a.T
    u, v, w = b.T
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=1)


def _z_to(axis: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """A rotation that takes z to a unit vector; none at all where that is z."""
    if axis[2] == 1:
        return np.eye(3)
    across = np.eye(3)[np.abs(axis).argmin()]
    x = np.cross(across, axis) / np.linalg.norm(np.cross(across, axis))
    return np.stack([x, np.cross(axis, x), axis], axis=1)


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
    """The chain between two links of a URDF.

    Raises:
        MissingData: If there is no such file.
        InvalidSetting: If it is no URDF, or no serial chain of turning joints leads from one link to the other.
        UnknownName: If there is no such link.
    """
    return chain_of(read_urdf(path).joints_between(base, tip))


def chain_of(joints: Iterable[Any]) -> Chain:
    """The chain of some joints of a URDF; fixed ones are merged into their neighbours.

    Raises:
        InvalidSetting: If an axis has no direction.
    """
    before, axes, fixed = [], [], np.eye(4)
    for joint in joints:
        fixed = fixed @ placement(joint)
        if joint.type != "fixed":
            before.append(fixed)
            axes.append(axis_of(joint))
            fixed = np.eye(4)
    return Chain(np.stack(before), np.stack(axes), fixed)
