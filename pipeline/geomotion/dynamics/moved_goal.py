"""A field whose goal is moved on the way."""

import torch
from torch import nn

from geomotion.dynamics.fields import TimedVelocity
from geomotion.errors import ShapeMismatch
from geomotion.types import Float, State, Tensor, Velocity


class MovedGoal(nn.Module):
    """ẋ = f(x - s(t), t) with a shift s that is constant between changes, and zero before the first.

    What contracts to one trajectory before a change contracts to the shifted one after it, at the same rate.

    Args:
        field: f.
        times_s: When the shift changes, increasing [s].
        shifts: What it is from then on, shape (change, D).

    Raises:
        ShapeMismatch: If there is not one shift of D coordinates for each time.
    """

    times_s: Tensor
    shifts: Tensor

    def __init__(self, field: TimedVelocity, times_s: Float[Tensor, " change"], shifts: Float[Tensor, "_ D"]) -> None:
        super().__init__()
        if shifts.shape != (len(times_s), field.dim):
            raise ShapeMismatch("shifts of the goal", (len(times_s), field.dim), tuple(shifts.shape))
        self.field, self.dim = field, field.dim
        self.register_buffer("times_s", times_s)
        self.register_buffer("shifts", torch.cat([torch.zeros_like(shifts[:1]), shifts]))

    def shift(self, elapsed_s: Float[Tensor, "*batch 1"]) -> State:
        """s at times since the start of the motion [s]."""
        return self.shifts[(elapsed_s >= self.times_s).sum(dim=-1)]

    def forward(self, x: State) -> Velocity:
        return self.velocity(x, torch.zeros_like(x[..., :1]))

    def velocity(self, x: State, elapsed_s: Float[Tensor, "*batch 1"]) -> Velocity:
        """ẋ at states and times since the start of the motion [s]."""
        return self.field.velocity(x - self.shift(elapsed_s), elapsed_s)
