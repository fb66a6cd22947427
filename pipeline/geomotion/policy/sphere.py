"""A ball in the way, told anew with every question."""

from dataclasses import dataclass

import torch

from geomotion.obstacles.modulation import flow_around
from geomotion.obstacles.solids import unit
from geomotion.obstacles.ways import own_way
from geomotion.types import Float, State, Tensor, Velocity


@dataclass(frozen=True)
class Avoidance:
    """How a policy avoids the ball; see :class:`geomotion.obstacles.modulation.ModulatedField`.

    Attributes:
        reactivity: ρ of Eq. (5.12).
        escape: Whether a tangential field, on the way that the field itself prefers, helps where the ball would bring
            the motion to rest. Trying several ways beforehand needs a ball that is known beforehand.
        recovery_time_s: How long a state inside takes to leave it [s].
        hold: Whether the ball slows what moves away from it, too.
    """

    reactivity: float = 1.0
    escape: bool = True
    recovery_time_s: float = 0.1
    hold: bool = False


@dataclass(frozen=True)
class TensorSphere:
    """A ball as tensors, so that an exported policy can be told where it is.

    Attributes:
        reference: Its centre, shape (1, D) [m].
        radius: Shape (1, 1) [m]; 0 for none.
        velocity: Shape (1, D) [m/s].
    """

    reference: Float[Tensor, "1 D"]
    radius: Float[Tensor, "1 1"]
    velocity: Float[Tensor, "1 D"]

    @property
    def dim(self) -> int:
        """D."""
        return self.reference.shape[-1]

    def level(self, x: State) -> Float[Tensor, "*batch"]:
        """Γ."""
        inside: Tensor = torch.where(self.radius > 0, self.radius, 1)
        return ((x - self.reference) / inside).square().sum(dim=-1)

    def normal(self, x: State) -> State:
        """Away from the centre."""
        return unit(x - self.reference)

    def modulate(self, x: State, wanted: Velocity, avoidance: Avoidance) -> Velocity:
        """ẋ at states, from what the field wants there, which it is where there is no ball."""
        relative = wanted - self.velocity
        way = own_way if avoidance.escape else None
        settings = avoidance.reactivity, avoidance.recovery_time_s, avoidance.hold
        around = self.velocity + flow_around(self, self.radius, x, relative, way, *settings)
        return torch.where(self.radius > 0, around, wanted)
