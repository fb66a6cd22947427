"""Fields that flow around obstacles by dynamic modulation.

Proven: at the surface of an obstacle the velocity relative to it has no normal component, so no trajectory enters one.
Not proven: that a contracting field stays contracting.

Source: Huber, Slotine, Billard (2022), Avoiding dense and dynamic obstacles in enclosed spaces; Thesis Sec. 5.4.
"""

from collections.abc import Sequence
from copy import copy
from functools import partial

import torch
from torch import nn

from geomotion.dynamics.fields import TimedVelocity, VectorField
from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.obstacles.contact import Contact, Surface
from geomotion.obstacles.obstacle import Obstacle
from geomotion.obstacles.solids import length, unit
from geomotion.obstacles.ways import Way, choose_way, escape, own_way
from geomotion.types import Float, Matrix, State, Tensor, Velocity

RECOVERED = 0.1  # of the smallest radius: the depth up to which the field's own crossing speed fades in


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
    contact = Contact.at(obstacle, x, reactivity)
    decay = contact.decay[..., None]
    eye = torch.eye(obstacle.dim).to(x)
    return (1 + decay) * eye - 2 * decay * contact.lift[..., :, None] * contact.normal[..., None, :]


class PositionSlice(nn.Module):
    """The velocity of the position as a field of the position alone, the other coordinates held.

    Args:
        field: Of states that begin with a position.
        held: The other coordinates, shape (D - Dx,).
    """

    held: Tensor

    def __init__(self, field: VectorField, held: Float[Tensor, " other"]) -> None:
        super().__init__()
        self.field, self.dim = field, field.dim - len(held)
        self.register_buffer("held", held)

    def forward(self, x: State) -> Velocity:
        velocity: Velocity = self.field(torch.cat([x, self.held.expand(*x.shape[:-1], -1)], dim=-1))
        return velocity[..., : self.dim]


class ModulatedField(nn.Module):
    """A field with obstacles in it.

    Each obstacle alone gives ẋ_o = v_o + G_o (f - v_o) with its velocity v_o; together they give the mean of these with
    weights ∝ 1/(Γ_o - 1), for speeds and for angles to f apart. At the surface of one obstacle only this one counts.

    Started inside an obstacle, a state is driven out along the reference direction, at the speed with which the field
    crosses the level sets plus a part that grows with depth. Both vanish at the surface, so that the field is
    continuous there.

    Args:
        field: f.
        obstacles: One or more, in the precision of the states.
        reactivity: ρ of Eq. (5.12).
        escape: Whether a tangential field helps where obstacles bring the motion to rest, Eq. (6.9): around the
            obstacle on one of several ways, see :mod:`geomotion.obstacles.ways`.
        recovery_time_s: How long the second part takes to cross the obstacle's smallest radius [s].
        hold: Whether an obstacle slows what moves away from it, too, as (5.12) has it: behind it, states at its surface
            then leave as slowly as others approach it.
        time_s: When velocities are asked for, for moving obstacles [s].
        held: Where states are more than a position: what the other coordinates are when ways around obstacles are tried
            out, shape (D - obstacle.dim,). Only the velocity of the position is modulated.

    Raises:
        ShapeMismatch: If obstacles and field differ in dimension, less what is held.
        InvalidSetting: If a number is not positive, or there is no obstacle.
    """

    def __init__(
        self,
        field: VectorField,
        obstacles: Sequence[Obstacle],
        reactivity: float = 1.0,
        escape: bool = True,
        recovery_time_s: float = 0.1,
        hold: bool = False,
        time_s: float = 0.0,
        held: Float[Tensor, " other"] | None = None,
    ) -> None:
        super().__init__()
        for name, value in (("reactivity", reactivity), ("recovery_time_s", recovery_time_s)):
            if value <= 0:
                raise InvalidSetting(f"obstacle.{name}", value, "a number above 0")
        if not obstacles:
            raise InvalidSetting("obstacle", "none", "an obstacle or more")
        self.field, self.dim = field, field.dim
        self.space = field.dim if held is None else field.dim - len(held)
        for obstacle in obstacles:
            if obstacle.dim != self.space:
                raise ShapeMismatch("coordinates of an obstacle", self.space, obstacle.dim)
        self.moving = field if held is None else PositionSlice(field, held)
        self.obstacles = tuple(obstacles)
        self.reactivity, self.recovery_time_s, self.hold, self.time_s = reactivity, recovery_time_s, hold, time_s
        self.ways = [self._way(obstacle) if escape else None for obstacle in obstacles]

    def forward(self, x: State) -> Velocity:
        return self.velocity(x, torch.full_like(x[..., :1], self.time_s))

    def velocity(self, x: State, time: Float[Tensor, "*batch 1"]) -> Velocity:
        """ẋ at states and times since the obstacles were where their reference points say [s]."""
        wanted = self.field.velocity(x, time) if isinstance(self.field, TimedVelocity) else self.field(x)
        return self.modulate(x, wanted, time)

    def modulate(self, x: State, wanted: Velocity, time: Float[Tensor, "*batch 1"]) -> Velocity:
        """What obstacles make of velocities at states and times [s]."""
        modulated = self._modulate(self.position(x), self.position(wanted), time)
        return modulated if self.space == self.dim else torch.cat([modulated, wanted[..., self.space :]], dim=-1)

    def position(self, x: Float[Tensor, "*batch D"]) -> Float[Tensor, "*batch Dx"]:
        """The part of states that obstacles stand in the way of."""
        return x[..., : self.space]

    def _modulate(self, x: State, wanted: Velocity, time: Float[Tensor, "*batch 1"]) -> Velocity:
        shifted = [x - obstacle.velocity * time for obstacle in self.obstacles]
        pairs = list(zip(self.obstacles, shifted, strict=True))
        velocities = [
            obstacle.velocity + self._flow(obstacle, y, wanted - obstacle.velocity, way)
            for (obstacle, y), way in zip(pairs, self.ways, strict=True)
        ]
        if len(velocities) == 1:
            return velocities[0]
        levels = torch.stack([obstacle.level(y) for obstacle, y in pairs])
        return _mean_velocity(torch.stack(velocities), _weights(levels), wanted)

    def at_time(self, time_s: float) -> "ModulatedField":
        """The same field at another time."""
        later = copy(self)
        later.time_s = time_s
        return later

    def _way(self, obstacle: Obstacle) -> Way:
        """Of an obstacle that moves, where a trial would be out of date, the one that f prefers."""
        if bool(obstacle.velocity.any()):
            return own_way
        return choose_way(self.moving, obstacle, partial(self._flow, obstacle))

    def _flow(self, obstacle: Obstacle, x: State, relative: Velocity, way: Way | None) -> Velocity:
        return flow_around(
            obstacle, obstacle.inradius, x, relative, way, self.reactivity, self.recovery_time_s, self.hold
        )


def flow_around(
    obstacle: Surface,
    inradius: float | Tensor,
    x: State,
    relative: Velocity,
    way: Way | None,
    reactivity: float,
    recovery_time_s: float,
    hold: bool = False,
) -> Velocity:
    """Velocities that one obstacle alone makes of others, all relative to its own; see :class:`ModulatedField`.

    Args:
        obstacle: As it stands where `x` is told.
        inradius: Radius of a ball around its reference point that it contains [m].
        x: States.
        relative: f less the obstacle's velocity.
        way: Along which to escape; None: no tangential field.
        reactivity: ρ.
        recovery_time_s: How long a state inside takes to cross `inradius` [s].
        hold: Whether obstacles also slow what moves away from them.
    """
    contact = Contact.at(obstacle, x, reactivity)
    velocity = contact.modulate(relative, hold)
    if way is not None:
        velocity = velocity + contact.modulate(escape(contact, relative, velocity, way(contact, relative)))
    depth = (1 - contact.level).clamp(min=0) * inradius
    crossing = contact.crossing(relative).abs() * (depth / (RECOVERED * inradius)).clamp(max=1)
    return velocity + (crossing + depth / recovery_time_s) * contact.lift


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
