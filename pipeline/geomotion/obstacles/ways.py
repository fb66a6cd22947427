"""Ways around an obstacle for motions that it would bring to rest, Eq. (6.9), and which of them to take.

A modulated field stops on a surface where f points against the reference direction. If f parts there, the stop is a
saddle, and a tangential field need only shorten the stay. If f comes together there, as contracting fields do, it
attracts; then a tangential field has to lead all states of that side the same way. Which way is right depends on f
beyond the surface ("highly problem-dependent", Sec. 6.3), so each is tried from all over the surface.
"""

import math
from collections.abc import Callable
from functools import partial

import torch

from geomotion.dynamics.fields import VectorField
from geomotion.obstacles.contact import Contact
from geomotion.obstacles.obstacle import Obstacle, surface_points
from geomotion.obstacles.solids import length, unit
from geomotion.types import Float, State, Tensor, Velocity

Way = Callable[[Contact, Velocity], State]
"""Tangents of length one, shorter where they would flip, from states and velocities of f relative to the obstacle."""

PROGRESS = 0.2  # share of the speed of f below which a state is helped along its way
HEAD_ON = 0.1  # share of the speed of f that has to point into the obstacle before a state is helped fully
NO_PREFERENCE = 1e-6  # of the whole: a smaller tangential part says nothing about the way around
CLEAR_PREFERENCE = 0.05  # of the whole: from here on, a way has its full length

STEP = 0.1  # of the smallest radius, when ways are tried
DETOUR = 6  # times the bounding radius: who is not away after a way as long as this and half a turn is trapped
AWAY = 4.0  # of Γ
TRIALS = {2: 64, 3: 200}


def own_way(contact: Contact, relative: Velocity) -> State:
    """The one that f itself prefers; any where it has no preference."""
    preferred = contact.tangential(unit(relative))
    return torch.where(length(preferred) > NO_PREFERENCE, _shortened(preferred), _any_tangent(contact.normal))


def way_towards(exit_: Float[Tensor, " D"]) -> Way:
    """Straight to one direction from the reference point; from the opposite one as f prefers."""

    def way(contact: Contact, relative: Velocity) -> State:
        to_exit = contact.tangential(exit_.expand_as(relative))
        return torch.where(length(to_exit) > NO_PREFERENCE, _shortened(to_exit), own_way(contact, relative))

    return way


def turning_way(sense: float) -> Way:
    """Always left (1) or always right (-1) around an obstacle in the plane, as seen from inside it."""

    def way(contact: Contact, relative: Velocity) -> State:
        return sense * torch.stack([-contact.normal[..., 1], contact.normal[..., 0]], dim=-1)

    return way


def escape(contact: Contact, relative: Velocity, modulated: Velocity, way: State) -> Velocity:
    """β g: along a way, as much as it takes to get on at `PROGRESS` of the speed of f, where f points inwards."""
    speed = length(relative).clamp(min=torch.finfo(relative.dtype).tiny)
    progress = (modulated * way).sum(dim=-1, keepdim=True)
    missing = ((PROGRESS * speed - progress) / (1 + contact.decay)).clamp(min=0)
    head_on = (-contact.crossing(relative) / (HEAD_ON * speed)).clamp(0, 1)
    return contact.decay * head_on * torch.minimum(missing, speed) * way


@torch.no_grad()
def choose_way(field: VectorField, obstacle: Obstacle, flow: Callable[..., Velocity]) -> Way:
    """The way on which most states get away from all over the surface: that of f, if none is better.

    Args:
        field: f.
        obstacle: At rest.
        flow: The modulated velocity at states, from that of f, and with a way as ``way=``.
    """
    starts = surface_points(obstacle, _directions(obstacle))
    best: Way = own_way
    most = _share_away(field, obstacle, starts, partial(flow, way=best))
    if most == 1:
        return best
    turning = [turning_way(1.0), turning_way(-1.0)] if obstacle.dim == 2 else []
    for way in (way_towards(_exit_direction(field, obstacle)), *turning):
        share = _share_away(field, obstacle, starts, partial(flow, way=way))
        if share > most:
            best, most = way, share
    return best


def _share_away(
    field: VectorField, obstacle: Obstacle, starts: State, flow: Callable[[State, Velocity], Velocity]
) -> float:
    """Share of starts that get away, or to where f itself rests; steps are as long where f is slow."""
    x, is_away = starts, torch.zeros_like(starts[:, 0], dtype=torch.bool)
    step = STEP * obstacle.inradius
    top_speed = float(length(field(starts)).max())
    for _ in range(_steps(obstacle)):
        wanted = field(x)
        speed = length(wanted)
        x = x + step * flow(x, wanted) / speed.clamp(min=torch.finfo(x.dtype).tiny)
        is_away |= (obstacle.level(x) > AWAY) | (speed[:, 0] < 0.01 * top_speed)
        if bool(is_away.all()):
            break
    return float(is_away.double().mean())


def _exit_direction(field: VectorField, obstacle: Obstacle) -> Float[Tensor, " D"]:
    """From the reference point to where the trajectory of f through it leaves; where f points, if it does not."""
    x = obstacle.reference[None]
    step = STEP * obstacle.inradius
    for _ in range(_steps(obstacle)):
        x = x + step * unit(field(x + step / 2 * unit(field(x))))
        if bool(obstacle.level(x) > 1):
            return unit(x - obstacle.reference)[0]
    return unit(field(obstacle.reference[None]))[0]


def _steps(obstacle: Obstacle) -> int:
    return math.ceil((DETOUR + math.pi) * obstacle.bounding_radius / (STEP * obstacle.inradius))


def _directions(obstacle: Obstacle) -> Float[Tensor, "direction D"]:
    """Evenly around in the plane, otherwise random with a fixed seed."""
    if obstacle.dim == 2:
        angles = torch.arange(TRIALS[2]) * (2 * math.pi / TRIALS[2])
        return torch.stack([angles.cos(), angles.sin()], dim=-1).to(obstacle.reference)
    generator = torch.Generator().manual_seed(0)
    return unit(torch.randn(TRIALS[3], obstacle.dim, generator=generator)).to(obstacle.reference)


def _shortened(tangent: State) -> State:
    """At length one, but continuous where it vanishes: what flips has no trajectories that a solver could follow."""
    return tangent / length(tangent).clamp(min=CLEAR_PREFERENCE)


def _any_tangent(normal: State) -> State:
    """A unit vector across the normal: the most transverse axis, projected; zero in one dimension."""
    axis = torch.eye(normal.shape[-1]).to(normal)[normal.abs().argmin(dim=-1)]
    return unit(axis - normal * (axis * normal).sum(dim=-1, keepdim=True))
