"""Rollouts in phases: the condition may change on the way, and the field with it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from geomotion.conditional_models import ConditionalSkill
from geomotion.config import ObstacleConfig, RolloutConfig, SeveralObstacles, SolidObstacle, SolverConfig
from geomotion.dynamics.embedded import EmbeddedField
from geomotion.dynamics.injective import rollout_on_manifold
from geomotion.dynamics.linear import LinearField
from geomotion.dynamics.potential import PotentialField
from geomotion.dynamics.rollout import Rollout, RolloutStatus
from geomotion.dynamics.rollout import rollout as follow
from geomotion.errors import InvalidSetting
from geomotion.models import Skill
from geomotion.obstacles.modulation import ModulatedField
from geomotion.obstacles.obstacle import clearance
from geomotion.obstacles.rollout import rollout_among_obstacles
from geomotion.stages.scene import modulated, solids
from geomotion.types import Float, Tensor, Times

GOAL_TOLERANCE = 0.02  # of the size of the demonstrations
REGION = 3.0  # sizes of the demonstrations: trajectories that end farther from their middle have left the region


@dataclass(frozen=True)
class Start:
    """Where one rollout begins and at which times it is wanted; under which condition, where that is known.

    Attributes:
        label: What to call it.
        state: Shape (D,) [m].
        times: Increasing, from 0 [s].
        condition: That of the demonstration whose start it is.
    """

    label: str
    state: np.ndarray
    times: np.ndarray
    condition: tuple[float, ...] = ()


@dataclass(frozen=True)
class Phase:
    """A stretch of time with one field, whose clock is at zero when the phase begins.

    Attributes:
        begins_s: Time since the start [s].
        condition: What holds then; empty for a skill without conditions.
        skill: The skill under this condition.
        field: The same among obstacles, which are where they are when the phase begins; None in free space.
    """

    begins_s: float
    condition: tuple[float, ...]
    skill: Skill
    field: ModulatedField | None


@dataclass(frozen=True)
class Followed:
    """A trajectory through all phases.

    Attributes:
        states: At the wanted times, shape (time, D) [m].
        velocities: Of the field that holds then [m/s].
        status: How it ends, judged by the last phase.
        method: What computed it.
        note: What differs from what was asked for; empty if nothing.
        clearance_m: Smallest distance to an obstacle at the wanted times, negative inside; None in free space.
        changes: What each change of the condition meant, for programs.
    """

    states: Float[Tensor, "time D"]
    velocities: Float[Tensor, "time D"]
    status: RolloutStatus
    method: str
    note: str
    clearance_m: float | None
    changes: tuple[Mapping[str, Any], ...]


def phases(
    config: RolloutConfig, obstacle: ObstacleConfig, skill: Skill | ConditionalSkill, own: tuple[float, ...]
) -> list[Phase]:
    """The fields that a rollout follows, in turn.

    Args:
        config: Condition and changes of it.
        obstacle: What stands in the way.
        skill: What was learned.
        own: Condition of the demonstration whose start it is; empty if none.

    Raises:
        InvalidSetting: If a condition is missing or does not fit, or there should be none; if an obstacle does not fit.
    """
    if isinstance(skill, Skill):
        for name in ("condition", "switches"):
            if getattr(config, name):
                raise InvalidSetting(f"rollout.{name}", getattr(config, name), "null: this skill knows no conditions")
        return [Phase(0.0, (), skill, modulated(obstacle, skill))]
    first = config.condition if config.condition is not None else own
    schedule = [(0.0, "rollout.condition", skill.conditioning.checked(first or [], "rollout.condition"))]
    for switch in config.switches:
        key = "rollout.switches.condition"
        schedule.append((float(switch["time_s"]), key, skill.conditioning.checked(switch["condition"], key)))
    plain = [(begins, condition, skill.given(condition, key)) for begins, key, condition in schedule]
    return [
        Phase(begins, condition, skill_then, modulated(later(obstacle, begins), skill_then))
        for begins, condition, given in plain
        for skill_then in [replace(given, field=given.field.later(begins))]
    ]


def follow_phases(
    all_phases: Sequence[Phase], start: Start, solver: SolverConfig, on_manifold: bool = False
) -> Followed:
    """Follow one field after the other; phases that begin after the last wanted time never do.

    Args:
        all_phases: Fields and when they begin.
        start: Where and when.
        solver: How trajectories are computed.
        on_manifold: Whether the skill has a decoder on whose manifold the start is: in free space codes are followed.
    """
    dtype = all_phases[0].skill.goal.dtype
    state, wanted = torch.as_tensor(start.state, dtype=dtype)[None], torch.as_tensor(start.times, dtype=dtype)
    begun = [phase for phase in all_phases if phase.begins_s < float(wanted[-1]) or phase.begins_s == 0]
    ends = [*(phase.begins_s for phase in begun[1:]), math.inf]
    parts, velocities, clearances, notes, changes = [], [], [], [], []
    for phase, end in zip(begun, ends, strict=True):
        own = wanted[(wanted >= phase.begins_s) & (wanted < end)]
        grid = torch.unique(torch.cat([own, wanted.new_tensor([phase.begins_s, min(end, float(wanted[-1]))])]))
        found = _follow(phase, state, grid, solver, on_manifold)
        kept = found.states[0, torch.isin(grid, own)]
        parts.append(kept)
        velocities.append(_velocities(phase, kept, own))
        if phase.field is not None:
            clearances.append(float(clearance(phase.field.obstacles, phase.field.position(kept), own - phase.begins_s)))
        notes.append(found.note)
        if phase.begins_s > 0:
            changes.append(_change(phase, found.states[0], grid))
        state = found.states[:, -1]
    nearest = min((gap for gap in clearances if math.isfinite(gap)), default=None)
    return Followed(
        torch.cat(parts), torch.cat(velocities), found.statuses[0], found.method,
        " ".join(dict.fromkeys(note for note in notes if note)), nearest, tuple(changes),
    )  # fmt: skip


def _follow(
    phase: Phase, state: Float[Tensor, "1 D"], times: Times, solver: SolverConfig, on_manifold: bool
) -> Rollout:
    geometry = phase.skill.geometry
    centre = torch.tensor(geometry.centre).to(state)
    reach = REGION * 2 * geometry.scale_m
    options: dict[str, Any] = {
        "method": solver.method.value,
        "substeps": solver.substeps,
        "relative_tolerance": solver.relative_tolerance,
        "absolute_tolerance": solver.absolute_tolerance,
        "goal": phase.skill.goal,
        "goal_tolerance": GOAL_TOLERANCE * 2 * geometry.scale_m,
        "region": (centre - reach, centre + reach),
    }
    if phase.field is None and on_manifold:
        return rollout_on_manifold(phase.skill.field, state, times, **options)
    if phase.field is None:
        return follow(phase.skill.field, state, times, **options)
    return rollout_among_obstacles(phase.field, state, times, **options)


@torch.no_grad()
def _velocities(phase: Phase, states: Float[Tensor, "time D"], times: Times) -> Float[Tensor, "time D"]:
    field = phase.skill.field if phase.field is None else phase.field
    return field.velocity(states, (times - phase.begins_s)[:, None])


@torch.no_grad()
def _change(phase: Phase, states: Float[Tensor, "time D"], times: Times) -> dict[str, Any]:
    """When the condition changed, to what, and what contraction promises from there on.

    Distances to the goal are those of the claimed metric, ‖ψ_c(x)‖; ``bound_at_end``, for the end of the phase, is the
    one right after the change times e^{-τ(t - s)}, or what a time law makes of it. Nothing is promised where no rate is
    proven, or among obstacles.
    """
    field = phase.skill.field
    change = {
        "time_s": phase.begins_s,
        "condition": list(phase.condition),
        "goal_m": list(phase.skill.geometry.goal),
    }
    if phase.field is not None or not isinstance(field.field, LinearField | PotentialField | EmbeddedField):
        return change
    z = field.chart.to_latent(states[[0, -1]])
    progress = field.law_at(z).progress((times[-1] - times[0]) / field.time_unit_s)
    distances, decay = z.norm(dim=-1).tolist(), math.exp(-field.field.rate * float(progress))
    bound = {"metric_distance": distances[0], "at_end": distances[1], "bound_at_end": decay * distances[0]}
    return change | bound if all(map(math.isfinite, distances)) else change


def later(obstacle: ObstacleConfig, time_s: float) -> ObstacleConfig:
    """The obstacles where their velocities take them meanwhile."""
    if isinstance(obstacle, SeveralObstacles):
        return replace(obstacle, bodies=[_moved(body, time_s) for body in solids(obstacle)])
    return _moved(obstacle, time_s) if isinstance(obstacle, SolidObstacle) else obstacle


def _moved(body: SolidObstacle, time_s: float) -> SolidObstacle:
    if body.velocity_m_per_s is None:
        return body
    pairs = zip(body.centre_m, body.velocity_m_per_s, strict=True)
    return replace(body, centre_m=[place + time_s * speed for place, speed in pairs])
