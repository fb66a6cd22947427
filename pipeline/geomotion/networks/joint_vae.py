"""Variational auto-encoder of an arm's configurations, with its forward kinematics as a fixed last layer."""

import math
from collections.abc import Sequence

import torch
from torch import nn

from geomotion.networks.mlp import MLP
from geomotion.networks.pose_vae import LOG_VARIANCE_RANGE, TYPICAL_STD
from geomotion.networks.rbf import RadialBasisNetwork
from geomotion.robot.kinematics import ForwardKinematics
from geomotion.types import Float, Tensor

ROTATION_SCALE = 1 / math.sqrt(8)  # of matrices, whose distances are then those of unit quaternions


class JointVAE(nn.Module):
    """Encoder, decoder of mean configurations, their spread as a radial basis network, and the arm's kinematics.

    As with poses, configurations carry their progress along the demonstration.

    Args:
        kinematics: Points of the body, and the end effector; without parameters.
        centre_rad: Of the configurations, shape (joint,).
        scale_rad: One unit of the scaled configurations.
        scale_m: One unit of length.
        latent_dim: d.
        hidden_units: Widths of the encoder's hidden layers; the decoder has them in reverse.
        kernels: Of the radial basis network.
        largest_std: σ far from the data [scale_rad].
        encodes_progress: Whether the encoder sees the progress.

    Source: Thesis Eq. (4.1)-(4.3), Fig. 4.2, Sec. 4.3.2.
    """

    centre_rad: Tensor
    lever: Tensor
    turn: Tensor

    def __init__(
        self,
        kinematics: ForwardKinematics,
        centre_rad: Sequence[float],
        scale_rad: float,
        scale_m: float,
        latent_dim: int,
        hidden_units: Sequence[int],
        kernels: int,
        largest_std: float,
        encodes_progress: bool = True,
    ) -> None:
        super().__init__()
        joints = len(centre_rad)
        self.kinematics, self.scale_rad, self.scale_m = kinematics, scale_rad, scale_m
        self.latent_dim, self.encodes_progress = latent_dim, encodes_progress
        self.encoder = MLP(joints + 1, 2 * latent_dim, hidden_units)
        self.decoder = MLP(latent_dim, joints + 1, tuple(reversed(hidden_units)))
        self.precision = RadialBasisNetwork(kernels, latent_dim, 1 / largest_std)
        self.register_buffer("centre_rad", torch.tensor(centre_rad), persistent=False)
        centre = self.centre_rad.double()
        _, of_points, of_turn = kinematics.jacobians(centre)
        self.register_buffer("lever", torch.linalg.matrix_norm(of_points).float(), persistent=False)
        self.register_buffer("turn", torch.linalg.matrix_norm(of_turn).float(), persistent=False)

    def encode(
        self, joints: Float[Tensor, "*batch joint"], progress: Float[Tensor, "*batch"]
    ) -> tuple[Float[Tensor, "*batch d"], Float[Tensor, "*batch d"]]:
        """Mean and log-variance of the approximate posterior of scaled configurations."""
        centred = (2 * progress[..., None] - 1) * self.encodes_progress
        mean, log_variance = self.encoder(torch.cat([joints, centred], dim=-1)).chunk(2, dim=-1)
        return mean, log_variance.clamp(*LOG_VARIANCE_RANGE)

    def reconstruct(
        self, z: Float[Tensor, "*batch d"]
    ) -> tuple[Float[Tensor, "*batch joint"], Float[Tensor, "*batch"]]:
        """Mean scaled configurations at latent points, and the progress."""
        output = self.decoder(z)
        return output[..., :-1], output[..., -1]

    def joints_rad(self, z: Float[Tensor, "*batch d"]) -> Float[Tensor, "*batch joint"]:
        """Mean configurations [rad]."""
        joints: Tensor = self.centre_rad + self.scale_rad * self.reconstruct(z)[0]
        return joints

    def std(self, z: Float[Tensor, "*batch d"]) -> Float[Tensor, "*batch"]:
        """σ of every joint [scale_rad]."""
        std: Tensor = self.precision(z).reciprocal()
        return std

    def blocks(
        self, z: Float[Tensor, "*batch d"], raw: bool = False
    ) -> tuple[Float[Tensor, "*batch B 4"], Float[Tensor, "*batch 10"]]:
        r"""What the metric is pulled back from: a block for each point of the body, and the end effector's turn.

        A block is the point p_b(μ) and ‖J_b‖_F σ, the root mean square distance that the spread of the joints gives it:
        with :math:`J_{FK}` at the mean, :math:`E[J^\top J] = (J_{FK} J_\mu)^\top (J_{FK} J_\mu) + \|J_{FK}\|_F^2
        \nabla\sigma \nabla\sigma^\top` for one σ of all joints, where (4.3) has :math:`J_{FK} J_\sigma`. The norm is
        taken at the mean configuration of the data, so that blocks are functions whose chords give lengths.

        Source: Thesis Eq. (2.10), (4.3).
        """
        points, quaternion = self.kinematics(self.joints_rad(z))
        spread_rad = self.scale_rad * self.std(z)[..., None]
        body = torch.cat([points, (self.lever * spread_rad)[..., None]], dim=-1) / self.scale_m
        turned = ROTATION_SCALE * rotation_matrix(quaternion).flatten(-2)
        return body, torch.cat([turned, self.turn * spread_rad / 2], dim=-1)

    def positions(self, z: Float[Tensor, "*batch d"]) -> Float[Tensor, "*batch B 3"]:
        """Mean positions of the points of the body [m]."""
        points: Tensor = self.kinematics(self.joints_rad(z))[0]
        return points

    def place_kernels(self, centres: Float[Tensor, "kernel d"], width: float) -> None:
        """Put the kernels of the spread there."""
        self.precision.place(centres, width, 1 / TYPICAL_STD)


def rotation_matrix(quaternion: Float[Tensor, "*batch 4"]) -> Float[Tensor, "*batch 3 3"]:
    """Rotations of unit quaternions wxyz, the same for q and -q."""
    w, x, y, z = quaternion.unbind(dim=-1)
    rows = [
        torch.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], dim=-1),
        torch.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], dim=-1),
        torch.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], dim=-1),
    ]
    return torch.stack(rows, dim=-2)
