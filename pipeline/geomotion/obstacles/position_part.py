"""Obstacles for states of more than a position: the position goes around them, everything else moves on as before."""

import torch
from torch import nn

from geomotion.dynamics.fields import TimedVelocity
from geomotion.obstacles.modulation import ModulatedField
from geomotion.types import Float, State, Tensor, Velocity

SPACE = 3


class PositionSlice(nn.Module):
    """The velocity of the position as a field of the position alone, the other coordinates held.

    Args:
        field: Of states whose first three coordinates are a position.
        held: The other coordinates, shape (D - 3,).
    """

    held: Tensor

    def __init__(self, field: TimedVelocity, held: Float[Tensor, " other"]) -> None:
        super().__init__()
        self.field, self.dim = field, SPACE
        self.register_buffer("held", held)

    def forward(self, x: State) -> Velocity:
        velocity: Velocity = self.field(torch.cat([x, self.held.expand(*x.shape[:-1], -1)], dim=-1))[..., :SPACE]
        return velocity


class ModulatedPosition(nn.Module):
    """A field of which only the velocity of the position is modulated.

    No position enters an obstacle; of contraction, nothing is claimed.

    Args:
        field: Of states whose first three coordinates are a position.
        around: Modulation of a :class:`PositionSlice` of it, which decides on ways around obstacles.
    """

    def __init__(self, field: TimedVelocity, around: ModulatedField) -> None:
        super().__init__()
        self.field, self.around, self.dim = field, around, field.dim

    def forward(self, x: State) -> Velocity:
        return self.velocity(x, torch.zeros_like(x[..., :1]))

    def velocity(self, x: State, elapsed_s: Float[Tensor, "*batch 1"]) -> Velocity:
        """ẋ at states and times since the obstacles were where their reference points say [s]."""
        wanted = self.field.velocity(x, elapsed_s)
        position = self.around.modulate(x[..., :SPACE], wanted[..., :SPACE], elapsed_s)
        return torch.cat([position, wanted[..., SPACE:]], dim=-1)
