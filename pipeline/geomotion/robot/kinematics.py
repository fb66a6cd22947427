"""Forward kinematics as a layer of a network: body points, their Jacobians, and the volume measure."""

import numpy as np
import torch
from scipy.spatial.transform import Rotation
from torch import nn

from geomotion.errors import ShapeMismatch
from geomotion.robot.arm import Arm
from geomotion.robot.body import BodyPoints
from geomotion.types import Float, Tensor

Joints = Float[Tensor, "*batch joint"]
Points = Float[Tensor, "*batch point 3"]
Quaternions = Float[Tensor, "*batch 4"]


class ForwardKinematics(nn.Module):
    """f_FK of Thesis Sec. 4.1: joint positions to body points and the orientation of the tip.

    Nothing in it is trained. It computes in the number type, and on the device, of the joint positions. All results
    can be differentiated, also twice.

    Args:
        arm: The arm.
        body: Points fixed to its links; radii do not matter here.
    """

    _fixed: Tensor
    _axes: Tensor
    _fixed_turns: Tensor
    _frame: Tensor
    _offset: Tensor
    _moves: Tensor

    def __init__(self, arm: Arm, body: BodyPoints) -> None:
        super().__init__()
        chain = arm.chain
        before, to_frame = chain.about_z
        turns = np.concatenate([chain.before, chain.tip[None]])[:, :3, :3]
        constants = {
            "fixed": before[:, :3],
            "axes": chain.axes,
            "fixed_turns": Rotation.from_matrix(turns).as_quat(scalar_first=True),
            "frame": body.frame.astype(np.int64),
            "offset": (to_frame[body.frame] @ body.offset_m[:, :, None])[:, :, 0],
            "moves": np.arange(len(before)) <= body.frame[:, None],
        }
        for name, values in constants.items():
            self.register_buffer(f"_{name}", torch.from_numpy(values.copy()), persistent=False)

    def forward(self, q: Joints) -> tuple[Points, Quaternions]:
        """Points [m] in the base frame, and the tip's orientation, wxyz.

        Of ±orientation it is the one with w ≥ 0, so that it jumps to its negative where the tip has turned by 180°.

        Raises:
            ShapeMismatch: If there is not one angle [rad] per joint.
        """
        self._require_angles(q)
        return self._points(*self._frames(q)), self._orientation(q)

    def jacobians(
        self, q: Joints
    ) -> tuple[Points, Float[Tensor, "*batch point 3 joint"], Float[Tensor, "*batch 3 joint"]]:
        """Points [m], the Jacobians of their velocities [m/rad], and that of the tip's angular velocity, base frame.

        Column k is the axis of joint k × the lever from it to the point, and the axis itself.

        Raises:
            ShapeMismatch: If there is not one angle [rad] per joint.
        """
        self._require_angles(q)
        rotations, origins = self._frames(q)
        points = self._points(rotations, origins)
        axes = rotations[..., 2].transpose(-1, -2)
        levers = (points[..., None] - origins.transpose(-1, -2)[..., None, :, :]) * self._moves.to(q)[:, None, :]
        return points, _cross(axes[..., None, :, :], levers), axes

    def log_volume(self, q: Joints, regularisation: float) -> Float[Tensor, "*batch"]:
        """log V, the logarithm of the volume measure: ½ log det (JᵀJ + λI), Thesis Eq. (4.2), Sec. 4.3.2.

        J stacks the Jacobians of all points and of the tip's rotation. At singular configurations det JᵀJ can be zero,
        and its logarithm without bound; λ bounds it from below.

        Args:
            q: [rad].
            regularisation: λ, above 0.

        Raises:
            ShapeMismatch: If there is not one angle per joint.
        """
        _, of_points, of_turn = self.jacobians(q)
        J = torch.cat([of_points.flatten(-3, -2), of_turn], dim=-2)
        identity = torch.eye(J.shape[-1], dtype=q.dtype, device=q.device)
        root = torch.linalg.cholesky(J.mT @ J + regularisation * identity)
        logarithm: Float[Tensor, "*batch"] = root.diagonal(dim1=-2, dim2=-1).log().sum(dim=-1)
        return logarithm

    def _frames(self, q: Joints) -> tuple[Float[Tensor, "*batch joint 3 3"], Float[Tensor, "*batch joint 3"]]:
        """Rotations and origins, in the base frame, of frames that turn with the joints about their own z axes."""
        sine, cosine, fixed = q.sin(), q.cos(), self._fixed.to(q)
        rotation, origin = torch.eye(3).to(q).expand(*q.shape[:-1], 3, 3), q.new_zeros(*q.shape[:-1], 3)
        frames = []
        for joint in range(q.shape[-1]):
            origin = origin + rotation @ fixed[joint, :, 3]
            x, y, z = (rotation @ fixed[joint, :, :3]).unbind(-1)
            c, s = cosine[..., joint, None], sine[..., joint, None]
            rotation = torch.stack([c * x + s * y, c * y - s * x, z], dim=-1)
            frames.append((rotation, origin))
        rotations, origins = zip(*frames, strict=True)
        return torch.stack(rotations, dim=-3), torch.stack(origins, dim=-2)

    def _points(self, rotations: Float[Tensor, "*batch joint 3 3"], origins: Float[Tensor, "*batch joint 3"]) -> Points:
        turned = rotations[..., self._frame, :, :] @ self._offset.to(rotations)[..., None]
        return origins[..., self._frame, :] + turned[..., 0]

    def _orientation(self, q: Joints) -> Quaternions:
        """A product of quaternions, which is smooth everywhere, other than their reading from a matrix."""
        half = q[..., None] / 2
        turns = torch.cat([half.cos(), half.sin() * self._axes.to(q)], dim=-1)
        first, *others = self._fixed_turns.to(q)
        whole = first.expand(*q.shape[:-1], 4)
        for joint, fixed in enumerate(others):
            whole = _product(_product(whole, turns[..., joint, :]), fixed)
        return torch.where(whole[..., :1] < 0, -whole, whole)

    def _require_angles(self, q: Joints) -> None:
        if q.shape[-1:] != self._axes.shape[:1]:
            raise ShapeMismatch("joint positions", f"(..., {len(self._axes)})", tuple(q.shape))


def _cross(a: Float[Tensor, "*#batch 3 joint"], b: Float[Tensor, "*#batch 3 joint"]) -> Float[Tensor, "*batch 3 joint"]:
    """Of columns; written out because torch's takes half as long again where there are many."""
    x, y, z = a.unbind(-2)
    u, v, w = b.unbind(-2)
    return torch.stack([y * w - z * v, z * u - x * w, x * v - y * u], dim=-2)


def _product(p: Float[Tensor, "*#batch 4"], q: Float[Tensor, "*#batch 4"]) -> Quaternions:
    """Hamilton's, scalar first."""
    a, b, c, d = p.unbind(-1)
    w, x, y, z = q.unbind(-1)
    return torch.stack(
        [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ],
        dim=-1,
    )
