"""Unit quaternions, rotation vectors, and how fast both turn.

Written with plain products and :func:`torch.where`, so that an exported policy contains them.

Source:
    Thesis Sec. 6.2.1; Solà, Deray, Atchuthan (2018), A micro Lie theory for state estimation in robotics.
"""

import torch

from geomotion.errors import InvalidSetting
from geomotion.types import Float, Tensor

Quaternion = Float[Tensor, "*batch 4"]  # scalar first, of length one
RotationVector = Float[Tensor, "*batch 3"]  # axis times angle [rad]
SMALL = 1e-2  # below which functions of an angle are taken from their series, which are exact to rounding there


def rotation_vector(quaternion: Quaternion) -> RotationVector:
    """Log on S³, of length up to 2π: that of -q turns the other way round.

    A rotation as such has the shorter of the two, that of the sign with a positive scalar part.
    """
    scalar, vector = quaternion[..., :1], quaternion[..., 1:]
    sine = vector.norm(dim=-1, keepdim=True)
    angle = 2 * _angle(sine, scalar)
    # near the identity, angle/sine is 2/scalar (1 - tan²/3); near its antipode it has no limit
    tangent = sine / torch.where(scalar == 0, 1, scalar)
    near = (sine < SMALL) & (scalar > 0)
    series = 2 * (1 - tangent.square() / 3 + tangent.pow(4) / 5) / torch.where(scalar == 0, 1, scalar)
    return vector * torch.where(near, series, angle / torch.where(sine == 0, 1, sine))


def quaternion(rotation: RotationVector) -> Quaternion:
    """Exp on S³."""
    half = rotation.norm(dim=-1, keepdim=True) / 2
    return torch.cat([half.cos(), rotation * (_sinc(half) / 2)], dim=-1)


def product(left: Float[Tensor, "*#batch 4"], right: Float[Tensor, "*#batch 4"]) -> Quaternion:
    """Hamilton product: first turn by `right`, then by `left`."""
    (a, u), (b, v) = ((one[..., :1], one[..., 1:]) for one in (left, right))
    scalar = a * b - (u * v).sum(-1, keepdim=True)
    around = torch.linalg.cross(*torch.broadcast_tensors(u, v))  # type: ignore[no-untyped-call]
    return torch.cat([scalar, a * v + b * u + around], dim=-1)


def inverse(quaternion: Quaternion) -> Quaternion:
    """The turn back."""
    return torch.cat([quaternion[..., :1], -quaternion[..., 1:]], dim=-1)


def angular_velocity(rotation: RotationVector, rate: RotationVector) -> RotationVector:
    r"""ω of a rotation vector that changes, in the frame that is at rest [rad/s].

    .. math:: \omega = \dot r + \tfrac{1-\cos\theta}{\theta^2}\, r\times\dot r
        + \tfrac{\theta-\sin\theta}{\theta^3}\, r\times(r\times\dot r)
    """
    angle = rotation.norm(dim=-1, keepdim=True)
    once = torch.linalg.cross(rotation, rate)
    omega: Tensor = rate + _sinc(angle / 2).square() / 2 * once + _sine_rest(angle) * torch.linalg.cross(rotation, once)
    return omega


def mean_quaternion(quaternions: Float[Tensor, "point 4"]) -> Float[Tensor, " 4"]:
    """The rotation with the least mean squared sine of half the angle to all; the sign of each does not matter.

    Source:
        Markley, Cheng, Crassidis, Oshman (2007), Averaging quaternions.

    Raises:
        InvalidSetting: If rotations point everywhere alike, so that none is in the middle.
    """
    spread, axes = torch.linalg.eigh(quaternions.T @ quaternions / len(quaternions))
    if spread[-1] - spread[-2] < 1e-3:
        raise InvalidSetting("orientations", "spread evenly over all rotations", "those that have a mean")
    mean = axes[:, -1]
    signed: Tensor = mean * torch.where(mean[0] < 0, -1.0, 1.0).to(mean)
    return signed


def _angle(sine: Tensor, cosine: Tensor) -> Tensor:
    """Of both, in (-π, π].

    A runtime of exported policies may know arctangents in single precision alone; one step of Newton's method from
    there has an error of the third order.
    """
    rough = torch.atan2(sine.float(), cosine.float()).to(sine)
    return rough + sine * rough.cos() - cosine * rough.sin()


def _sinc(angle: Tensor) -> Tensor:
    """sin(a)/a."""
    square = angle.square()
    return torch.where(
        angle < SMALL, 1 - square / 6 + square.square() / 120, angle.sin() / torch.where(angle == 0, 1, angle)
    )


def _sine_rest(angle: Tensor) -> Tensor:
    """(a - sin a)/a³."""
    square = angle.square()
    safe = torch.where(angle < SMALL, 1, angle)
    return torch.where(angle < SMALL, 1 / 6 - square / 120, (safe - safe.sin()) / safe.pow(3))
