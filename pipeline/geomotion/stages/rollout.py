"""Trajectories of a trained field that a robot can execute."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from geomotion import models
from geomotion.config import ObstacleConfig, RolloutConfig, SolverConfig
from geomotion.demos import storage
from geomotion.demos.demonstrations import VELOCITY_OF, Demonstrations, Trajectory
from geomotion.dynamics.rollout import Rollout, RolloutStatus
from geomotion.dynamics.rollout import rollout as follow
from geomotion.errors import InvalidSetting
from geomotion.figures.rollouts import PlanarRollouts, figure_rollouts
from geomotion.figures.style import save_figure
from geomotion.files import write_json
from geomotion.models import Skill
from geomotion.obstacles.modulation import ModulatedField
from geomotion.obstacles.obstacle import clearance, surface_points
from geomotion.obstacles.rollout import rollout_among_obstacles
from geomotion.stages.scene import modulated
from geomotion.tables import aligned
from geomotion.tracking import Artefacts, StageRun

GOAL_TOLERANCE = 0.02  # of the size of the demonstrations
OUTLINE_POINTS = 200


@dataclass(frozen=True)
class RolloutStageConfig:
    """What the rollout stage needs."""

    rollout: RolloutConfig
    solver: SolverConfig
    obstacle: ObstacleConfig


@dataclass(frozen=True)
class Start:
    """Where one rollout begins and at which times it is wanted."""

    label: str
    state: np.ndarray
    times: np.ndarray


def rollout(config: RolloutStageConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``rollouts/`` (trajectories in the layout of demonstrations) and ``rollouts.json`` (how each one ended).

    With obstacles, the modulated field is followed; where obstacles move, each rollout begins when they are where the
    configuration puts them. Rollouts in a plane are drawn, ``figures/rollouts``.

    Raises:
        InvalidSetting: If starts or obstacles do not fit the skill.
    """
    skill = models.load(inputs["train"].path("model.pt"))
    demonstrations = storage.load(inputs["ingest"].folder)
    starts = _starts(config.rollout, demonstrations, skill)
    field = modulated(config.obstacle, skill)
    outcomes = [_follow(skill, field, start, config.solver) for start in starts]
    pairs = zip(starts, outcomes, strict=True)
    trajectories = tuple(
        found for start, outcome in pairs if (found := _trajectory(skill, field, start, outcome)) is not None
    )
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
    write_json(run.folder / "rollouts.json", _document(skill, field, starts, outcomes))
    if skill.field.dim == 2:
        picture = _picture(skill, field, demonstrations, trajectories)
        save_figure(figure_rollouts(picture), run.folder / "figures", "rollouts", picture.arrays())


def rollout_table(document: Mapping[str, Any]) -> str:
    """Plain text: one line a rollout."""
    has_obstacles = document["rollouts"][0]["clearance_m"] is not None
    rows = [("start", "duration", "to goal", *["clearance"] * has_obstacles, "outcome")]
    for row in document["rollouts"]:
        lengths = [row["distance_to_goal_m"], *[row["clearance_m"]] * has_obstacles]
        shown = ["infinite" if metres is None else f"{1000 * metres:.2f} mm" for metres in lengths]
        rows.append((row["start"], f"{row['duration_s']:.2f} s", *shown, row["outcome"]))
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


def _follow(skill: Skill, field: ModulatedField | None, start: Start, solver: SolverConfig) -> Rollout:
    dtype = skill.goal.dtype
    state, times = torch.as_tensor(start.state, dtype=dtype)[None], torch.as_tensor(start.times, dtype=dtype)
    options: dict[str, Any] = {
        "method": solver.method.value,
        "substeps": solver.substeps,
        "relative_tolerance": solver.relative_tolerance,
        "absolute_tolerance": solver.absolute_tolerance,
        "goal": skill.goal,
        "goal_tolerance": GOAL_TOLERANCE * 2 * skill.geometry.scale_m,
    }
    if field is None:
        return follow(skill.field, state, times, **options)
    return rollout_among_obstacles(field, state, times, **options)


def _trajectory(skill: Skill, field: ModulatedField | None, start: Start, outcome: Rollout) -> Trajectory | None:
    """What a robot can execute of a rollout: all points before the first that is not finite, if they are two."""
    states = outcome.states[0]
    with torch.no_grad():
        if field is None:
            velocities = skill.field(states)
        else:
            velocities = field.velocity(states, torch.as_tensor(start.times).to(states)[:, None])
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


def _clearance(field: ModulatedField | None, start: Start, outcome: Rollout) -> float | None:
    """Smallest distance to an obstacle at the output times [m], negative inside."""
    if field is None:
        return None
    states = outcome.states[0]
    found = float(clearance(field.obstacles, states, torch.as_tensor(start.times).to(states)))
    return found if math.isfinite(found) else None


def _picture(
    skill: Skill, field: ModulatedField | None, demonstrations: Demonstrations, rollouts: tuple[Trajectory, ...]
) -> PlanarRollouts:
    angles = torch.linspace(0, 2 * torch.pi, OUTLINE_POINTS + 1).to(skill.goal)
    around = torch.stack([angles.cos(), angles.sin()], dim=-1)
    obstacles = () if field is None else field.obstacles
    outlines = [surface_points(obstacle, around).double().numpy() for obstacle in obstacles]
    duration = max(rollout.duration_s for rollout in rollouts)
    ways = [duration * obstacle.velocity.double().numpy() for obstacle in obstacles]
    return PlanarRollouts(
        [one.state(skill.state_channels) for one in demonstrations.trajectories],
        [one.channels[skill.state_channels[0]] for one in rollouts],
        outlines,
        [outline + way for outline, way in zip(outlines, ways, strict=True)],
        np.asarray(skill.geometry.goal),
    )


def _document(
    skill: Skill, field: ModulatedField | None, starts: list[Start], outcomes: list[Rollout]
) -> dict[str, Any]:
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
                "reached_goal": outcome.statuses[0] is RolloutStatus.reached,
                "clearance_m": _clearance(field, start, outcome),
                "method": outcome.method,
                "note": outcome.note,
            }
        )
    return {"goal_m": list(skill.geometry.goal), "rollouts": rows}
