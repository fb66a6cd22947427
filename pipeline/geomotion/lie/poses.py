"""Poses as vectors of six coordinates, all of them lengths, each vector a pose."""

from dataclasses import dataclass
from typing import Any, Literal

import torch
from torch import nn

from geomotion.lie.cover import FIRST_COVER, Cover, CubeCover, RadialCover
from geomotion.lie.rotations import (
    angular_velocity,
    inverse,
    product,
    quaternion,
    rotation_vector,
)
from geomotion.types import Float, State, Tensor, Velocity

Group = Literal["SO3", "S3"]
CoverName = Literal["radial", "cube"]
POSE_DIM = 6
Positions = Float[Tensor, "*batch 3"]  # [m]
Orientations = Float[Tensor, "*batch 4"]  # unit quaternions wxyz
COVERS: dict[CoverName, type[RadialCover] | type[CubeCover]] = {"radial": RadialCover, "cube": CubeCover}


@dataclass(frozen=True)
class Twist:
    """How fast a pose changes, both in the frame that is at rest.

    Attributes:
        velocity: Of the position [m/s].
        omega: Of the orientation [rad/s].
    """

    velocity: Positions
    omega: Positions


class PoseCoordinates(nn.Module):
    """x = (p, ℓ u): position, and the rotation vector of R R_refᵀ without the edge of its first cover, times a lever.

    Args:
        reference: R_ref as a unit quaternion wxyz, shape (4,): the middle of what is demonstrated.
        lever_m: ℓ, the length that counts as much as a radian [m].
        group: ``SO3``, where q and -q are one orientation, or ``S3``, where they are a whole turn apart.
        cover: ``radial``, which is smooth, or ``cube``, Eq. (6.4).

    Source:
        Thesis Sec. 6.2.2, with the mean orientation as the origin of Log.
    """

    reference: Tensor

    def __init__(
        self, reference: Float[Tensor, " 4"], lever_m: float, group: Group = "SO3", cover: CoverName = "radial"
    ) -> None:
        super().__init__()
        self.register_buffer("reference", reference / reference.norm())
        self.lever_m = lever_m
        self.group: Group = group
        self.cover_name: CoverName = cover
        self.cover: Cover = COVERS[cover](FIRST_COVER[group])

    def to_vector(self, position: Positions, orientation: Orientations) -> State:
        """x of poses, shape (*batch, 6) [m]."""
        flat = self.cover.to_flat(self.turned_from_reference(orientation))
        return torch.cat([position, self.lever_m * flat], dim=-1)

    def to_pose(self, x: State) -> tuple[Positions, Orientations]:
        """Positions [m] and unit quaternions of vectors."""
        turn = self.cover.to_ball(x[..., 3:] / self.lever_m)
        return x[..., :3], product(quaternion(turn), self.reference)

    def twist(self, x: State, velocity: Velocity) -> Twist:
        """How fast the pose changes where its vector does."""
        flat, rate = x[..., 3:] / self.lever_m, velocity[..., 3:] / self.lever_m
        turn = self.cover.to_ball(flat)
        return Twist(velocity[..., :3], angular_velocity(turn, self.cover.push(flat, rate)))

    def turned_from_reference(self, orientation: Orientations) -> Positions:
        """The rotation vector from the reference to orientations [rad]."""
        turned = product(orientation, inverse(self.reference.to(orientation)))
        if self.group == "SO3":
            turned = torch.where(turned[..., :1] < 0, -turned, turned)
        return rotation_vector(turned)

    def document(self) -> dict[str, Any]:
        """Everything that it takes to make it again, as JSON types."""
        return {
            "reference_wxyz": self.reference.double().tolist(),
            "lever_m": self.lever_m,
            "group": self.group,
            "cover": self.cover_name,
        }

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> "PoseCoordinates":
        """What :meth:`document` describes, in double precision."""
        reference = torch.tensor(document["reference_wxyz"], dtype=torch.float64)
        return cls(reference, document["lever_m"], document["group"], document["cover"])
