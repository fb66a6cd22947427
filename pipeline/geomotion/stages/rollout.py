"""Trajectories of a trained field that a robot can execute."""

import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from dataclasses import field as default
from itertools import product
from typing import Any

import numpy as np
import torch

from geomotion import conditional_models
from geomotion.conditional_models import ConditionalSkill
from geomotion.config import NoObstacle, NoSafety, ObstacleConfig, RolloutConfig, SafetyConfig, SolverConfig
from geomotion.demos import storage
from geomotion.demos.demonstrations import VELOCITY_OF, Demonstrations, Trajectory
from geomotion.demos.pose_vectors import POSE_CHANNEL, with_pose_vectors
from geomotion.dynamics.rollout import RolloutStatus
from geomotion.errors import InvalidSetting
from geomotion.figures.arrays import Flow
from geomotion.figures.rollouts import PlanarRollouts, figure_rollouts
from geomotion.figures.style import save_figure
from geomotion.files import write_json
from geomotion.models import JOINT_CHANNEL, Skill
from geomotion.obstacles.obstacle import surface_points
from geomotion.safe_skills import SafeSkill
from geomotion.scores.evaluation import Unit
from geomotion.scores.grids import Box, bounding_box, sample_box
from geomotion.stages.evaluate import state_unit
from geomotion.stages.phases import Followed, Phase, Start, follow_phases, later, phases
from geomotion.stages.safe_motion import follow_in_region
from geomotion.stages.safety import safe
from geomotion.stages.transition import follow_after_transition
from geomotion.tables import aligned
from geomotion.tracking import Artefacts, StageRun
from geomotion.types import Float, Tensor

OUTLINE_POINTS = 200
CORNER = "corner"
CORNER_MARGIN = 0.2  # of the box around the demonstrations
CORNER_DURATIONS = 3.0  # as long as the first rollout: corners are farther from the goal
FLOW_POINTS_PER_AXIS = 40
FLOW_MARGIN = 0.05
FAR = 0.5  # of half the longest side of the box around the demonstrations: as exported policies have it by default
Outcome = tuple[Start, list[Phase], Followed]

_log = logging.getLogger("geomotion")


@dataclass(frozen=True)
class RolloutStageConfig:
    """What the rollout stage needs."""

    rollout: RolloutConfig
    solver: SolverConfig
    obstacle: ObstacleConfig
    safety: SafetyConfig = default(default_factory=NoSafety)


def rollout(config: RolloutStageConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``rollouts/`` (trajectories in the layout of demonstrations) and ``rollouts.json`` (how each one ended).

    With obstacles, the modulated field is followed; where obstacles move, each rollout begins when they are where the
    configuration puts them. A skill with conditions is followed under the condition of the configuration, or else of
    the demonstration; the condition may change on the way. Rollouts in a plane are drawn, ``figures/rollouts``.

    Raises:
        InvalidSetting: If starts, conditions or obstacles do not fit the skill.
    """
    skill = conditional_models.load(inputs["train"].path("model.pt"))
    demonstrations = storage.load(inputs["ingest"].folder)
    if isinstance(skill, Skill):
        demonstrations = with_pose_vectors(demonstrations, skill.pose)
    region = safe(config.safety, config.obstacle, skill, demonstrations)
    if region is not None:
        skill = replace(region.skill, field=region.charted_field())
    obstacle = NoObstacle() if region is not None else _when_followed(config, skill)
    starts = _starts(config.rollout, demonstrations, skill)
    planned = _planned(config.rollout, obstacle, skill, starts)
    followed = [
        (start, all_phases, _follow(config, region, all_phases, start))
        for start, all_phases in zip(starts, planned, strict=True)
    ]
    channels = _channels(skill)
    trajectories = tuple(
        found for start, _, outcome in followed if (found := _trajectory(skill, start, outcome)) is not None
    )
    if not trajectories:
        labels = ", ".join(start.label for start in starts)
        raise InvalidSetting("rollout", labels, "a start from which the trajectory stays finite for two points")
    if config.rollout.starts_m is not None:
        _warn_of_far(starts, bounding_box([one.state(channels) for one in demonstrations.trajectories]))
    storage.save(
        replace(
            demonstrations,
            name=f"{demonstrations.name}/rollouts",
            trajectories=trajectories,
            space=demonstrations.space if POSE_CHANNEL in channels else f"R{len(starts[0].state)}",
            condition_names=(),  # conditions may change on the way; rollouts.json has them
            source=f"computed by a field learned from {demonstrations.name}; {demonstrations.source}",
        ),
        run.folder / "rollouts",
    )
    write_json(run.folder / "rollouts.json", {"rollouts": [_row(*one) for one in followed]})
    if len(starts[0].state) == 2:
        demonstrated = [one.state(_channels(skill)) for one in demonstrations.trajectories]
        picture = _picture(followed, demonstrated, [(one.label, one.channels[channels[0]]) for one in trajectories])
        save_figure(figure_rollouts(picture), run.folder / "figures", "rollouts", picture.arrays())


def _planned(
    config: RolloutConfig, obstacle: ObstacleConfig, skill: Skill | ConditionalSkill, starts: Sequence[Start]
) -> list[list[Phase]]:
    """The fields that each start follows: the same under one condition, unless starts are remembered."""
    if isinstance(skill, Skill) and skill.field.start_memory is not None:
        return [phases(config, obstacle, skill.begun(start.state), start.condition) for start in starts]
    conditions = dict.fromkeys(start.condition for start in starts)
    planned = {condition: phases(config, obstacle, skill, condition) for condition in conditions}
    return [planned[start.condition] for start in starts]


def _follow(config: RolloutStageConfig, region: SafeSkill | None, all_phases: list[Phase], start: Start) -> Followed:
    if region is not None:
        return follow_in_region(region, start)
    transition_s = config.rollout.transition_s
    if transition_s is None or not _is_led(config, all_phases[0].skill):
        return follow_phases(all_phases, start, config.solver)
    return follow_after_transition(all_phases, start, config.solver, transition_s)


def _is_led(config: RolloutStageConfig, skill: Skill | ConditionalSkill) -> bool:
    """Whether starts are led to the manifold of a decoder first."""
    return isinstance(skill, Skill) and config.rollout.transition_s is not None and not skill.field.is_onto


def _when_followed(config: RolloutStageConfig, skill: Skill | ConditionalSkill) -> ObstacleConfig:
    """The obstacles where they are when a skill begins to be followed: during a transition phase they move on."""
    return later(config.obstacle, config.rollout.transition_s or 0.0) if _is_led(config, skill) else config.obstacle


def rollout_table(document: Mapping[str, Any]) -> str:
    """Plain text: one line a rollout."""
    has_obstacles = document["rollouts"][0]["clearance_m"] is not None
    rows = [("start", "duration", "to goal", *["clearance"] * has_obstacles, "outcome")]
    for row in document["rollouts"]:
        clearance = [_with_unit(row["clearance_m"], Unit("mm", 1000.0))] * has_obstacles
        to_goal = _with_unit(row["distance_to_goal_m"], Unit(*row["unit"]))
        rows.append((row["start"], f"{row['duration_s']:.2f} s", to_goal, *clearance, row["outcome"]))
    return aligned(rows)


def _with_unit(distance: float | None, unit: Unit) -> str:
    return "infinite" if distance is None else f"{unit.per_state_unit * distance:.2f} {unit.name}"


def _channels(skill: Skill | ConditionalSkill) -> tuple[str, ...]:
    return skill.state_channels if isinstance(skill, Skill) else skill.augmented.state_channels


def _starts(config: RolloutConfig, demonstrations: Demonstrations, skill: Skill | ConditionalSkill) -> list[Start]:
    starts = _chosen_starts(config, demonstrations, skill)
    if not config.corners:
        return starts
    channels = _channels(skill)
    box = bounding_box([one.state(channels) for one in demonstrations.trajectories]).enlarged(CORNER_MARGIN)
    corners = [np.array(corner) for corner in product(*zip(box.lower, box.upper, strict=True))]
    duration_s = config.duration_s or CORNER_DURATIONS * float(starts[0].times[-1])
    times, condition = np.linspace(0.0, duration_s, len(starts[0].times)), starts[0].condition
    return [*starts, *(Start(f"{CORNER} {number}", one, times, condition) for number, one in enumerate(corners))]


def _chosen_starts(
    config: RolloutConfig, demonstrations: Demonstrations, skill: Skill | ConditionalSkill
) -> list[Start]:
    if config.starts_m is not None:
        plain = skill if isinstance(skill, Skill) else skill.given(config.condition or [], "rollout.condition")
        times = np.linspace(0.0, config.duration_s or plain.geometry.duration_s, config.points or 1000)
        states = [_state(start, plain.field.dim) for start in config.starts_m]
        return [Start(f"start {number}", state, times) for number, state in enumerate(states)]
    chosen = demonstrations.select(config.demos if config.demos is not None else range(len(demonstrations)))
    numbers = config.demos if config.demos is not None else range(len(demonstrations))
    starts = []
    for number, one in zip(numbers, chosen.trajectories, strict=True):
        times = one.time_s - one.time_s[0]
        if config.duration_s is not None or config.points is not None:
            times = np.linspace(0.0, config.duration_s or one.duration_s, config.points or len(one))
        starts.append(Start(f"demonstration {number}", one.state(_channels(skill))[0], times, one.condition))
    return starts


def _warn_of_far(starts: Sequence[Start], demonstrated: Box) -> None:
    reach = FAR * float((demonstrated.upper - demonstrated.lower).max()) / 2
    for start in starts:
        beyond = np.maximum(demonstrated.lower - start.state, start.state - demonstrated.upper)
        if (farthest := float(beyond.max())) > reach:
            where = f"coordinate {int(beyond.argmax())} is {farthest:.3g} beyond all that was demonstrated"
            _log.warning("rollout: %s is far outside: %s, and the motion from there made up", start.label, where)


def _state(start: list[float], dim: int) -> np.ndarray:
    if len(start) != dim:
        raise InvalidSetting("rollout.starts_m", start, f"{dim} coordinates for each start")
    return np.asarray(start, dtype=float)


def _trajectory(skill: Skill | ConditionalSkill, start: Start, outcome: Followed) -> Trajectory | None:
    """What a robot can execute of a rollout: all points before the first that is not finite, if they are two."""
    is_finite = torch.cat([outcome.states, outcome.velocities], dim=-1).isfinite().all(dim=-1)
    points = int(is_finite.int().cumprod(0).sum())
    if points < 2:
        return None
    states, velocities = outcome.states[:points].double(), outcome.velocities[:points].double()
    return Trajectory(start.times[:points], _robot_channels(skill, states, velocities), start.label)


def _robot_channels(
    skill: Skill | ConditionalSkill, states: Float[Tensor, "time D"], velocities: Float[Tensor, "time D"]
) -> dict[str, np.ndarray]:
    plain = skill if isinstance(skill, Skill) else skill.augmented
    if plain.pose is None:
        channel = plain.state_channels[0]
        return {channel: states.numpy(), VELOCITY_OF[channel]: velocities.numpy()}
    (joints, pose), (turning, moving) = (one.tensor_split([plain.joints], dim=-1) for one in (states, velocities))
    position, orientation = plain.pose.to_pose(pose)
    found = {
        "position_m": position.numpy(),
        "orientation_wxyz": orientation.numpy(),
        VELOCITY_OF["position_m"]: moving[:, :3].numpy(),
    }
    if plain.joints:
        found |= {JOINT_CHANNEL: joints.numpy(), VELOCITY_OF[JOINT_CHANNEL]: turning.numpy()}
    return found


def _picture(
    followed: Sequence[Outcome], demonstrated: list[np.ndarray], rollouts: list[tuple[str, np.ndarray]]
) -> PlanarRollouts:
    _, (first, *_), _ = followed[0]
    field, goal = first.field, first.skill.goal
    angles = torch.linspace(0, 2 * torch.pi, OUTLINE_POINTS + 1).to(goal)
    around = torch.stack([angles.cos(), angles.sin()], dim=-1)
    obstacles = () if field is None else field.obstacles
    outlines = [surface_points(obstacle, around).double().numpy() for obstacle in obstacles]
    duration = max(float(start.times[-1]) for start, _, _ in followed)
    ways = [duration * obstacle.velocity.double().numpy() for obstacle in obstacles]
    goals = {phase.skill.geometry.goal for _, all_phases, _ in followed for phase in all_phases}
    return PlanarRollouts(
        demonstrated,
        [path for label, path in rollouts if not label.startswith(CORNER)],
        outlines,
        [outline + way for outline, way in zip(outlines, ways, strict=True)],
        np.array(sorted(goals)),
        [path for label, path in rollouts if label.startswith(CORNER)],
        _flow(first, [*demonstrated, *(path for _, path in rollouts)]) if len(goals) == 1 else None,
    )


@torch.no_grad()
def _flow(phase: Phase, paths: Sequence[np.ndarray]) -> Flow:
    """Velocities on a grid around everything that is drawn, where obstacles are at first; NaN inside of them."""
    points = sample_box(bounding_box(paths).enlarged(FLOW_MARGIN), FLOW_POINTS_PER_AXIS, seed=0).points
    states = torch.as_tensor(points, dtype=phase.skill.goal.dtype)
    if phase.field is None:
        return Flow(points, phase.skill.field(states).double().numpy())
    velocity = phase.field(states).double().numpy()
    covered = torch.stack([obstacle.level(states) < 1 for obstacle in phase.field.obstacles]).any(dim=0).numpy()
    return Flow(points, np.where(covered[:, None], np.nan, velocity))


def _row(start: Start, all_phases: list[Phase], outcome: Followed) -> dict[str, Any]:
    skill = all_phases[-1].skill
    distance = float((outcome.states[-1] - skill.goal).norm())
    row = {
        "start": start.label,
        "duration_s": float(start.times[-1]),
        "points": len(start.times),
        "goal_m": list(skill.geometry.goal),
        "status": outcome.status.name,
        "outcome": outcome.status.value,
        "unit": [*astuple(state_unit(skill.state_channels))],  # of printed distances; how many make one of the state's
        "distance_to_goal_m": distance if math.isfinite(distance) else None,
        "reached_goal": outcome.status is RolloutStatus.reached,
        "clearance_m": outcome.clearance_m,
        "method": outcome.method,
        "note": outcome.note,
    }
    if not all_phases[0].condition:
        return row
    return row | {"condition": list(all_phases[0].condition), "switches": list(outcome.changes)}
