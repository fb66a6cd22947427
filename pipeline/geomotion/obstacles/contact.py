"""States as seen from one obstacle, and velocities turned along its surface."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import torch

from geomotion.obstacles.solids import unit
from geomotion.types import Float, State, Tensor, Velocity


@runtime_checkable
class Surface(Protocol):
    """What contact asks of an obstacle."""

    @property
    def dim(self) -> int:
        """D."""
        ...

    @property
    def reference(self) -> Tensor:
        """Where every ray leaves it once [m]."""
        ...

    def level(self, x: State) -> Float[Tensor, "*batch"]:
        """Γ(x), see :class:`geomotion.obstacles.obstacle.Obstacle`."""
        ...

    def normal(self, x: State) -> State:
        """∇Γ/‖∇Γ‖."""
        ...


@dataclass(frozen=True)
class Contact:
    """Where states are, as seen from one obstacle.

    Attributes:
        level: Γ, shape (*batch, 1).
        decay: Γ^{-1/ρ}; inside the obstacle Γ counts as one.
        normal: Unit normal n of the level set.
        lift: r/(nᵀr): moves along the reference direction r, by one along the normal.
    """

    level: Float[Tensor, "*batch 1"]
    decay: Float[Tensor, "*batch 1"]
    normal: State
    lift: State

    @classmethod
    def at(cls, obstacle: Surface, x: State, reactivity: float) -> "Contact":
        """At the reference point, which has no direction, r and n are the first axis."""
        offset = x - obstacle.reference
        is_undefined = (offset == 0).all(dim=-1, keepdim=True)
        first = torch.eye(obstacle.dim).to(x)[0]
        direction = torch.where(is_undefined, first, unit(offset))
        normal = torch.where(is_undefined, first, obstacle.normal(x))
        lift = direction / (direction * normal).sum(dim=-1, keepdim=True)
        level = obstacle.level(x)[..., None]
        return cls(level, level.clamp(min=1) ** (-1 / reactivity), normal, lift)

    def crossing(self, velocity: Velocity) -> Float[Tensor, "*batch 1"]:
        """The normal component of a velocity."""
        return (velocity * self.normal).sum(dim=-1, keepdim=True)

    def tangential(self, velocity: Velocity) -> Velocity:
        """A velocity without its part along the reference direction."""
        return velocity - self.crossing(velocity) * self.lift

    def modulate(self, velocity: Velocity, hold: bool = False) -> Velocity:
        """G times a velocity, without the matrix.

        Args:
            velocity: Relative to the obstacle.
            hold: Whether an obstacle also slows what moves away from it, as (5.12) has it. Otherwise λ_n is 1 there.
        """
        crossing = self.crossing(velocity)
        slowed = 2.0 if hold else torch.where(crossing > 0, 1.0, 2.0)
        return (1 + self.decay) * velocity - slowed * self.decay * crossing * self.lift
