"""Trajectories of a trained field that a robot can execute."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from geomotion import models
from geomotion.config import RolloutConfig, SolverConfig
from geomotion.demos import storage
from geomotion.demos.demonstrations import VELOCITY_OF, Demonstrations, Trajectory
from geomotion.dynamics.rollout import Rollout
from geomotion.dynamics.rollout import rollout as follow
from geomotion.errors import InvalidSetting
from geomotion.files import write_json
from geomotion.models import Skill
from geomotion.tables import aligned
from geomotion.tracking import Artefacts, StageRun

GOAL_TOLERANCE = 0.02  # of the size of the demonstrations


@dataclass(frozen=True)
class RolloutStageConfig:
    """What the rollout stage needs."""

    rollout: RolloutConfig
    solver: SolverConfig


@dataclass(frozen=True)
class Start:
    """Where one rollout begins and at which times it is wanted."""

    label: str
    state: np.ndarray
    times: np.ndarray


def rollout(config: RolloutStageConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``rollouts/`` (trajectories in the layout of demonstrations) and ``rollouts.json`` (how each one ended)."""
    skill = models.load(inputs["train"].path("model.pt"))
    demonstrations = storage.load(inputs["ingest"].folder)
    starts = _starts(config.rollout, demonstrations, skill)
    outcomes = [_follow(skill, start, config.solver) for start in starts]
    pairs = zip(starts, outcomes, strict=True)
    trajectories = tuple(found for start, outcome in pairs if (found := _trajectory(skill, start, outcome)) is not None)
    if not trajectories:
        labels = ", ".join(start.label for start in starts)
        raise InvalidSetting("rollout", labels, "a start from which the trajectory stays finite for two points")
    storage.save(
        replace(
            demonstrations,
            name=f"{demonstrations.name}/rollouts",
            trajectories=trajectories,
            space=f"R{skill.field.dim}",
            source=f"computed by a field learned from {demonstrations.name}; {demonstrations.source}",
        ),
        run.folder / "rollouts",
    )
    write_json(run.folder / "rollouts.json", _document(skill, starts, outcomes))


def rollout_table(document: Mapping[str, Any]) -> str:
    """Plain text: one line a rollout."""
    rows = [("start", "duration", "to goal", "outcome")]
    for row in document["rollouts"]:
        metres = row["distance_to_goal_m"]
        distance = "infinite" if metres is None else f"{1000 * metres:.2f} mm"
        rows.append((row["start"], f"{row['duration_s']:.2f} s", distance, row["outcome"]))
    return aligned(rows)


def _starts(config: RolloutConfig, demonstrations: Demonstrations, skill: Skill) -> list[Start]:
    if config.starts_m is not None:
        duration = config.duration_s or skill.geometry.duration_s
        times = np.linspace(0.0, duration, config.points or 1000)
        return [
            Start(f"start {number}", _state(start, skill.field.dim), times)
            for number, start in enumerate(config.starts_m)
        ]
    chosen = demonstrations.select(config.demos if config.demos is not None else range(len(demonstrations)))
    numbers = config.demos if config.demos is not None else range(len(demonstrations))
    starts = []
    for number, one in zip(numbers, chosen.trajectories, strict=True):
        times = one.time_s - one.time_s[0]
        if config.duration_s is not None or config.points is not None:
            times = np.linspace(0.0, config.duration_s or one.duration_s, config.points or len(one))
        starts.append(Start(f"demonstration {number}", one.state(skill.state_channels)[0], times))
    return starts


def _state(start: list[float], dim: int) -> np.ndarray:
    if len(start) != dim:
        raise InvalidSetting("rollout.starts_m", start, f"{dim} coordinates for each start")
    return np.asarray(start, dtype=float)


def _follow(skill: Skill, start: Start, solver: SolverConfig) -> Rollout:
    dtype = skill.goal.dtype
    return follow(
        skill.field,
        torch.as_tensor(start.state, dtype=dtype)[None],
        torch.as_tensor(start.times, dtype=dtype),
        method=solver.method.value,
        substeps=solver.substeps,
        relative_tolerance=solver.relative_tolerance,
        absolute_tolerance=solver.absolute_tolerance,
        goal=skill.goal,
        goal_tolerance=GOAL_TOLERANCE * 2 * skill.geometry.scale_m,
    )


def _trajectory(skill: Skill, start: Start, outcome: Rollout) -> Trajectory | None:
    """What a robot can execute of a rollout: all points before the first that is not finite, if they are two."""
    states = outcome.states[0]
    with torch.no_grad():
        velocities = skill.field(states)
    is_finite = torch.cat([states, velocities], dim=-1).isfinite().all(dim=-1)
    points = int(is_finite.int().cumprod(0).sum())
    if points < 2:
        return None
    states, velocities = states[:points], velocities[:points]
    channel = skill.state_channels[0]
    return Trajectory(
        start.times[:points],
        {channel: states.double().numpy(), VELOCITY_OF[channel]: velocities.double().numpy()},
        start.label,
    )


def _document(skill: Skill, starts: list[Start], outcomes: list[Rollout]) -> dict[str, Any]:
    rows = []
    for start, outcome in zip(starts, outcomes, strict=True):
        distance = float((outcome.states[0, -1] - skill.goal).norm())
        rows.append(
            {
                "start": start.label,
                "duration_s": float(start.times[-1]),
                "points": len(start.times),
                "status": outcome.statuses[0].name,
                "outcome": outcome.statuses[0].value,
                "distance_to_goal_m": distance if math.isfinite(distance) else None,
                "method": outcome.method,
                "note": outcome.note,
            }
        )
    return {"goal_m": list(skill.geometry.goal), "rollouts": rows}
