"""Fields that flow around obstacles by dynamic modulation.

Proven: at the surface of an obstacle the velocity relative to it has no normal component, so no trajectory enters one.
Not proven: that a contracting field stays contracting.

Source: Huber, Slotine, Billard (2022), Avoiding dense and dynamic obstacles in enclosed spaces; Thesis Sec. 5.4.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import torch
from torch import nn

from geomotion.dynamics.fields import VectorField
from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.obstacles.obstacle import Obstacle
from geomotion.obstacles.solids import length, unit
from geomotion.types import Float, Matrix, State, Tensor, Velocity

STALLED = 0.2  # share of the field's own speed below which the escape field helps
NO_PREFERENCE = 1e-6  # of the field's speed: a smaller tangential part says nothing about the way around


@dataclass(frozen=True)
class Contact:
    """Where states are, as seen from one obstacle.

    Attributes:
        level: Γ, shape (*batch, 1).
        normal: Unit normal n of the level set.
        lift: r/(nᵀr): moves along the reference direction r, by one along the normal.
    """

    level: Float[Tensor, "*batch 1"]
    normal: State
    lift: State

    @classmethod
    def at(cls, obstacle: Obstacle, x: State) -> "Contact":
        """At the reference point, which has no direction, r and n are the first axis."""
        offset = x - obstacle.reference
        is_undefined = (offset == 0).all(dim=-1, keepdim=True)
        first = torch.eye(obstacle.dim).to(x)[0]
        direction = torch.where(is_undefined, first, unit(offset))
        normal = torch.where(is_undefined, first, obstacle.normal(x))
        lift = direction / (direction * normal).sum(dim=-1, keepdim=True)
        return cls(obstacle.level(x)[..., None], normal, lift)

    def decay(self, reactivity: float) -> Float[Tensor, "*batch 1"]:
        """Γ^{-1/ρ}; inside the obstacle Γ counts as one."""
        return self.level.clamp(min=1) ** (-1 / reactivity)

    def crossing(self, velocity: Velocity) -> Float[Tensor, "*batch 1"]:
        """The normal component of a velocity."""
        return (velocity * self.normal).sum(dim=-1, keepdim=True)

    def modulate(self, velocity: Velocity, reactivity: float) -> Velocity:
        """G times a velocity, without the matrix."""
        decay = self.decay(reactivity)
        return (1 + decay) * velocity - 2 * decay * self.crossing(velocity) * self.lift


def modulation_matrix(obstacle: Obstacle, x: State, reactivity: float = 1.0) -> Matrix:
    r"""What turns velocities along the surface of an obstacle.

    .. math:: G = E D E^{-1} = \lambda_\tau I + (\lambda_n - \lambda_\tau) \frac{r n^\top}{n^\top r}

    E = [r e₁ … e_{D-1}] with the direction r from the reference point and any basis of the plane across the normal n:
    the second form needs no basis, because the first row of E⁻¹ is nᵀ/(nᵀr). Inside the obstacle Γ counts as one.

    Args:
        obstacle: At time zero.
        x: States.
        reactivity: ρ; the larger, the farther an obstacle is felt.

    Source: Thesis Eq. (5.10)-(5.12).
    """
    contact = Contact.at(obstacle, x)
    decay = contact.decay(reactivity)[..., None]
    eye = torch.eye(obstacle.dim).to(x)
    return (1 + decay) * eye - 2 * decay * contact.lift[..., :, None] * contact.normal[..., None, :]


class ModulatedField(nn.Module):
    """A field with obstacles in it.

    Each obstacle alone gives ẋ_o = v_o + G_o (f - v_o) with its velocity v_o; together they give the mean of these with
    weights ∝ 1/(Γ_o - 1), for speeds and for angles to f apart. At the surface of one obstacle only this one counts.

    Started inside an obstacle, a state is driven out along the reference direction, at the speed with which the field
    crosses the level sets plus a part that grows with depth.

    Args:
        field: f.
        obstacles: One or more, in the precision of the states.
        reactivity: ρ of Eq. (5.12).
        escape: Whether a tangential field helps where obstacles bring the motion to rest, Eq. (6.9). It shortens the
            stay near a saddle, as convex obstacles have one; where the field converges from all sides to a point on an
            obstacle, it moves that point only.
        recovery_time_s: How long the second part takes to cross the obstacle's smallest radius [s].
        time_s: When velocities are asked for, for moving obstacles [s].

    Raises:
        ShapeMismatch: If obstacles and field differ in dimension.
        InvalidSetting: If a number is not positive, or there is no obstacle.
    """

    def __init__(
        self,
        field: VectorField,
        obstacles: Sequence[Obstacle],
        reactivity: float = 1.0,
        escape: bool = True,
        recovery_time_s: float = 0.1,
        time_s: float = 0.0,
    ) -> None:
        super().__init__()
        for name, value in (("reactivity", reactivity), ("recovery_time_s", recovery_time_s)):
            if value <= 0:
                raise InvalidSetting(f"obstacle.{name}", value, "a number above 0")
        if not obstacles:
            raise InvalidSetting("obstacle", "none", "an obstacle or more")
        for obstacle in obstacles:
            if obstacle.dim != field.dim:
                raise ShapeMismatch("coordinates of an obstacle", field.dim, obstacle.dim)
        self.field, self.dim = field, field.dim
        self.obstacles = tuple(obstacles)
        self.reactivity, self.escape, self.recovery_time_s = reactivity, escape, recovery_time_s
        self.time_s = time_s

    def forward(self, x: State) -> Velocity:
        return self.velocity(x, torch.full_like(x[..., :1], self.time_s))

    def velocity(self, x: State, time: Float[Tensor, "*batch 1"]) -> Velocity:
        """ẋ at states and times since the obstacles were where their reference points say [s]."""
        wanted = self.field(x)
        shifted = [x - obstacle.velocity * time for obstacle in self.obstacles]
        pairs = list(zip(self.obstacles, shifted, strict=True))
        velocities = [self._around(obstacle, y, wanted) for obstacle, y in pairs]
        if len(velocities) == 1:
            return velocities[0]
        levels = torch.stack([obstacle.level(y) for obstacle, y in pairs])
        return _mean_velocity(torch.stack(velocities), _weights(levels), wanted)

    def at_time(self, time_s: float) -> "ModulatedField":
        """The same field at another time."""
        later = copy(self)
        later.time_s = time_s
        return later

    def _around(self, obstacle: Obstacle, x: State, wanted: Velocity) -> Velocity:
        relative = wanted - obstacle.velocity
        contact = Contact.at(obstacle, x)
        velocity = contact.modulate(relative, self.reactivity)
        if self.escape:
            velocity = velocity + contact.modulate(_escape(contact, relative, velocity), self.reactivity)
        depth = (1 - contact.level) * obstacle.inradius
        push = (contact.crossing(relative).abs() + depth / self.recovery_time_s) * contact.lift
        return obstacle.velocity + velocity + torch.where(depth > 0, push, 0.0)


class TimedField(nn.Module):
    """A modulated field and its clock as one autonomous field: the last coordinate of a state is the time [s]."""

    def __init__(self, field: ModulatedField) -> None:
        super().__init__()
        self.field = field
        self.dim = field.dim + 1

    def forward(self, state: State) -> Velocity:
        time = state[..., -1:]
        return torch.cat([self.field.velocity(state[..., :-1], time), torch.ones_like(time)], dim=-1)


def _escape(contact: Contact, relative: Velocity, modulated: Velocity) -> Velocity:
    """β g: as fast as the field, along the surface, the stronger the slower the modulated motion is."""
    speed = length(relative)
    tangential = relative - contact.crossing(relative) * contact.lift
    way = torch.where(length(tangential) > NO_PREFERENCE * speed, unit(tangential), _any_tangent(contact.normal))
    share = length(modulated) / speed.clamp(min=torch.finfo(speed.dtype).tiny)
    return (1 - share / STALLED).clamp(min=0).square() * speed * way


def _any_tangent(normal: State) -> State:
    """A unit vector across the normal: the most transverse axis, projected; zero in one dimension."""
    axis = torch.eye(normal.shape[-1]).to(normal)[normal.abs().argmin(dim=-1)]
    return unit(axis - normal * (axis * normal).sum(dim=-1, keepdim=True))


def _weights(levels: Float[Tensor, "obstacle *batch"]) -> Float[Tensor, "obstacle *batch"]:
    """Shares ∝ 1/(Γ - 1). Source: Huber, Billard, Slotine (2019), Sec. IV."""
    closeness = 1 / (levels - 1).clamp(min=torch.finfo(levels.dtype).eps)
    return closeness / closeness.sum(dim=0)


def _mean_velocity(
    velocities: Float[Tensor, "obstacle *batch D"], weights: Float[Tensor, "obstacle *batch"], wanted: Velocity
) -> Velocity:
    """Mean of speeds, and of directions as angles to the unmodulated velocity: opposite turns do not cancel speed.

    Source: Huber, Billard, Slotine (2019), Sec. IV.
    """
    ahead, directions = unit(wanted), unit(velocities)
    along = (directions * ahead).sum(dim=-1, keepdim=True)
    across = directions - along * ahead
    turns = torch.atan2(length(across), along) * unit(across)
    turn = (weights[..., None] * turns).sum(dim=0)
    angle = length(turn)
    speed = (weights[..., None] * length(velocities)).sum(dim=0)
    return speed * unit(angle.cos() * ahead + angle.sin() * unit(turn))
