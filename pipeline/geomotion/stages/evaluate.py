"""Judge a trained field: scores, the arrays behind them, pictures, and the measured side of its certificate."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from dataclasses import field as default
from functools import partial
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from geomotion import models
from geomotion.config import (
    EvaluationConfig,
    NoObstacle,
    NoSafety,
    ObstacleConfig,
    Protocol,
    RiemannianSafety,
    SafetyConfig,
    SolverConfig,
)
from geomotion.demos import storage
from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.demos.pose_vectors import BODY_STATES, POSE_CHANNEL, with_pose_vectors
from geomotion.dynamics.embedded import EmbeddedField
from geomotion.errors import InvalidSetting
from geomotion.figures.evaluation import save_all
from geomotion.figures.safety import save_safety_figures
from geomotion.files import atomic, read_json, write_json
from geomotion.lie.poses import POSE_DIM, PoseCoordinates
from geomotion.models import Skill
from geomotion.scores.array_field import ArrayField
from geomotion.scores.contraction import judge_condition, judge_contraction
from geomotion.scores.evaluation import Evaluation, Unit, combine
from geomotion.scores.goal import judge_goal
from geomotion.scores.grids import Box, bounding_box, sample_box
from geomotion.scores.joints import ReturnProtocol, judge_joints, judge_returns
from geomotion.scores.latent_plane import latent_plane
from geomotion.scores.manifold_starts import judge_manifold_starts
from geomotion.scores.nearby import judge_nearby, nearby_starts
from geomotion.scores.off_manifold import Separation, judge_off_manifold
from geomotion.scores.paths import PosePath
from geomotion.scores.poses import JudgedPoses, judge_poses
from geomotion.scores.pushes import PushProtocol, judge_pushes
from geomotion.scores.reproduction import Judged, judge_reproduction
from geomotion.scores.support import RegionProtocol, judge_region
from geomotion.scores.table import scores_table
from geomotion.stages.evaluate_obstacles import certificate_part, judge_among_obstacles
from geomotion.stages.safety import certificate_part as safety_part
from geomotion.stages.safety import judge_safety, safe
from geomotion.stages.safety_picture import safety_picture
from geomotion.stages.step_times import judge_step_times
from geomotion.stages.verification import prove
from geomotion.tracking import Artefacts, StageRun

__all__ = ["EvaluateConfig", "compute", "evaluate", "scores_table"]

PEERS_TRIM_POINTS = 15
PEERS_TRAIN_DEMOS = (0, 1, 2, 3, 4)
POSE_NAMES = ("$x$ [m]", "$y$ [m]", "$z$ [m]", "turn about $x$ [m]", "turn about $y$ [m]", "turn about $z$ [m]")
PICTURE_POINTS_PER_AXIS = 40  # of the velocity field
DRAWN_STARTS = 40  # of motions in a safety region


@dataclass(frozen=True)
class EvaluateConfig:
    """What the evaluate stage needs.

    Attributes:
        evaluation: Protocol and grids.
        solver: How rollouts are computed.
        obstacle: Among what the field is judged as well.
        safety: In which region, obstacles in it.
    """

    evaluation: EvaluationConfig
    solver: SolverConfig
    obstacle: ObstacleConfig = default(default_factory=NoObstacle)
    safety: SafetyConfig = default(default_factory=NoSafety)


def evaluate(config: EvaluateConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``scores.json``, ``evaluation.npz``, ``certificate.json`` and the figures.

    Raises:
        InvalidSetting: If the peers' protocol is asked for on other data than theirs.
    """
    skill = models.load(inputs["train"].path("model.pt"))
    demonstrations = with_pose_vectors(storage.load(inputs["ingest"].folder), skill.pose)
    if config.evaluation.protocol is Protocol.peers:
        require_peers_data(skill.train_demos, demonstrations.steps)
    certificate = read_json(inputs["train"].path("certificate.json"))

    evaluation = compute(skill, demonstrations, certificate["rate_per_s"], config.evaluation, config.solver)
    known = np.concatenate([demonstrations[number].state(skill.state_channels) for number in skill.train_demos])
    proof, certificate = prove(certificate, skill.field, known, config.evaluation)
    region = safe(config.safety, config.obstacle, skill, demonstrations)
    obstacle = config.obstacle if region is None else NoObstacle()
    among = judge_among_obstacles(skill, demonstrations, obstacle, config.evaluation, config.solver)
    in_region = Evaluation()
    if region is not None and isinstance(config.safety, RiemannianSafety):
        in_region, starts = judge_safety(region, demonstrations, config.evaluation, config.safety.starts)
        save_safety_figures(safety_picture(region, starts[:DRAWN_STARTS]), run.folder / "figures")
        certificate["safety"] = safety_part(in_region)
    evaluation = combine([evaluation, proof, among, in_region])

    write_json(run.folder / "scores.json", evaluation.document(config.evaluation.protocol.value, demonstrations.name))
    with atomic(run.folder / "evaluation.npz") as temporary:
        np.savez_compressed(temporary, allow_pickle=False, **evaluation.arrays)
    certificate["audit"] = audit(evaluation)
    if among.scores:
        certificate["obstacles"] = certificate_part(among)
    write_json(run.folder / "certificate.json", certificate)
    run.log_scores(evaluation.scores)
    save_all(evaluation.arrays, certificate, run.folder / "figures")


def require_peers_data(train_demos: Sequence[int], steps: Sequence[str]) -> None:
    """Check that scores can stand beside those that peers publish.

    Args:
        train_demos: Numbers of the demonstrations that the model was fitted to.
        steps: Preprocessing steps as they are recorded with the data.

    Raises:
        InvalidSetting: If these are not demonstrations 0-4, or 15 points were not trimmed.
    """
    trimmed = any(step.startswith(f"trimmed {PEERS_TRIM_POINTS} points at the start") for step in steps)
    if not trimmed or tuple(train_demos) != PEERS_TRAIN_DEMOS:
        raise InvalidSetting(
            "evaluation",
            "peers",
            f"a model trained with dataset.train_demos={list(PEERS_TRAIN_DEMOS)} and dataset.preprocess."
            f"trim_start_points={PEERS_TRIM_POINTS}; found train_demos={list(train_demos)} and the steps {list(steps)}",
        )


def compute(
    skill: Skill,
    demonstrations: Demonstrations,
    proven_rate: float | None,
    settings: EvaluationConfig,
    solver: SolverConfig,
) -> Evaluation:
    """All scores of a model, without reading or writing files.

    Args:
        skill: The model.
        demonstrations: All demonstrations, with those it was fitted to.
        proven_rate: Contraction rate of its certificate [1/s]; None if nothing is proven.
        settings: Protocol and grids.
        solver: How rollouts are computed.
    """
    field = ArrayField(
        skill.field,
        method=solver.method.value,
        substeps=solver.substeps,
        relative_tolerance=solver.relative_tolerance,
        absolute_tolerance=solver.absolute_tolerance,
    )
    trained = [_judged(field, demonstrations[number], skill, True) for number in skill.train_demos]
    numbers = skill.test_demos if settings.protocol is Protocol.heldout else ()
    heldout = [_judged(field, demonstrations[number], skill, False) for number in numbers]
    scene = Scene.around(trained, settings.grid_margin)
    return combine(
        [
            judge_reproduction([*trained, *heldout], state_unit(skill.state_channels)),
            _poses(skill, [*trained, *heldout]),
            _joints(field, skill, [*trained, *heldout], settings, proven_rate),
            judge_off_manifold(skill.field, [*trained, *heldout], _separation(skill)),
            _manifold_starts(field, skill, scene, settings),
            _contraction(field, scene, settings, proven_rate),
            _region(field, scene, settings),
            _nearby(field, scene, settings, proven_rate),
            _goal(field, scene, settings, skill.goal.double().numpy()),
            _pushes(field, skill, heldout or trained, settings, proven_rate),
            _picture(field, scene),
            _names(skill, demonstrations),
            judge_step_times(skill, demonstrations.select(skill.train_demos), settings.timed_steps),
        ]
    )


def audit(evaluation: Evaluation) -> dict[str, Any]:
    """Measured numbers that bear on the claim of a certificate, under the names of their scores."""
    bearing = ("contraction.", "nearby.claimed.", "verification.")
    return {name: score.as_dict()["value"] for name, score in evaluation.scores.items() if name.startswith(bearing)}


def state_unit(channels: Sequence[str]) -> Unit:
    """Millimetres for positions, radians for joints; mixtures have no common unit."""
    units = {"position_m": Unit("mm", 1000.0), POSE_CHANNEL: Unit("mm", 1000.0), "joints_rad": Unit("rad")}
    kinds = {units.get(channel, Unit("state unit")) for channel in channels}
    return kinds.pop() if len(kinds) == 1 else Unit("state unit")


@dataclass(frozen=True)
class Scene:
    """What the training demonstrations say about where and for how long to judge a field.

    Attributes:
        states: All their states [m].
        start: Start of the first of them [m].
        time_s: Its times after the start [s].
        tight: Their bounding box.
        box: The same with a margin.
        duration_s: Their mean duration [s].
        step_s: Mean duration over mean number of points [s].
    """

    states: NDArray[np.float64]
    start: NDArray[np.float64]
    time_s: NDArray[np.float64]
    tight: Box
    box: Box
    duration_s: float
    step_s: float

    @classmethod
    def around(cls, trained: Sequence[Judged], margin: float) -> "Scene":
        """The scene of these demonstrations."""
        tight = bounding_box([one.states for one in trained])
        duration_s = float(np.mean([one.time_s[-1] for one in trained]))
        return cls(
            np.concatenate([one.states for one in trained]),
            trained[0].states[0],
            trained[0].time_s,
            tight,
            tight.enlarged(margin),
            duration_s,
            duration_s / float(np.mean([len(one.time_s) for one in trained])),
        )


def _judged(field: ArrayField, demonstration: Trajectory, skill: Skill, is_trained: bool) -> Judged:
    states = demonstration.state(skill.state_channels)
    time_s = demonstration.time_s - demonstration.time_s[0]
    velocities = demonstration.velocity(skill.state_channels)
    rollout = field.roll(states[:1], time_s)[0]
    # a plan has no velocities but its own
    led = field.begun(states[:1])
    predicted = np.gradient(rollout, time_s, axis=0) if field.is_plan else led.velocity(states, time_s)
    return Judged(time_s, states, velocities, rollout, predicted, is_trained)


def _poses(skill: Skill, judged: Sequence[Judged]) -> Evaluation:
    if skill.pose is None:
        return Evaluation()
    path = partial(_path, skill.pose)
    return judge_poses([JudgedPoses(path(one.states), path(one.rollout), one.is_trained) for one in judged])


def _joints(
    field: ArrayField, skill: Skill, judged: Sequence[Judged], settings: EvaluationConfig, proven_rate: float | None
) -> Evaluation:
    if not skill.joints or field.is_plan:
        return Evaluation()
    returns, rate = settings.joint_returns, proven_rate if field.field.is_onto else None
    protocol = ReturnProtocol(returns.count, returns.offset_rad, settings.seed)
    trained = [one for one in judged if one.is_trained]
    parts = [judge_joints(judged, skill.joints), judge_returns(field, trained, skill.joints, protocol, rate)]
    if isinstance(latent := skill.field.field, EmbeddedField):
        starts = np.repeat(trained[0].states[:1], returns.count, axis=0)
        starts[:, : skill.joints] += protocol.offsets(skill.joints)
        parts.append(latent_plane(field, trained[0], starts, latent.skill_dim))
    return combine(parts)


def _path(coordinates: PoseCoordinates, states: NDArray[np.float64]) -> PosePath:
    """Poses of states, which end with their vectors."""
    position, orientation = coordinates.to_pose(torch.as_tensor(states[..., -POSE_DIM:]))
    return PosePath(position.numpy(), orientation.numpy())


def _separation(skill: Skill) -> Separation:
    """Positions and orientations apart where states are poses."""
    coordinates, unit = skill.pose, state_unit(skill.state_channels)

    def separation(
        states: NDArray[np.float64], others: NDArray[np.float64]
    ) -> dict[str, tuple[str, NDArray[np.float64]]]:
        if coordinates is None:
            return {"distance": (unit.name, unit.per_state_unit * np.linalg.norm(states - others, axis=1))}
        apart_m, apart_rad = _path(coordinates, states).residuals(_path(coordinates, others))
        apart = {"position_distance": ("mm", 1000 * apart_m), "orientation_distance": ("deg", np.degrees(apart_rad))}
        if not skill.joints:
            return apart
        joints = np.sqrt(np.square((states - others)[:, : skill.joints]).mean(axis=1))
        return apart | {"joint_distance": ("deg", np.degrees(joints))}

    return separation


def _contraction(field: ArrayField, scene: Scene, settings: EvaluationConfig, proven_rate: float | None) -> Evaluation:
    if field.is_plan:
        return Evaluation(omitted={"contraction": "a plan has no velocity of a state, whose Jacobian could be taken"})
    grid = sample_box(scene.box, settings.contraction_grid_points, settings.seed)
    points = field.tensor(grid.points)
    place = {"grid_points": grid.points, "grid_shape": np.array(grid.shape, dtype=int)}
    parts = [Evaluation(arrays=place), judge_contraction(field.field, points, grid.note)]
    if proven_rate is not None and field.field.is_onto:  # elsewhere nothing is proven of arbitrary states
        parts.append(judge_condition(field.field, points, proven_rate, grid.note))
    return combine(parts)


def _region(field: ArrayField, scene: Scene, settings: EvaluationConfig) -> Evaluation:
    protocol = RegionProtocol(
        _starts_per_axis(settings),
        settings.region_steps,
        scene.step_s,
        settings.region_margin * scene.tight.diagonal,
    )
    return judge_region(field.roll, scene.states, scene.box, protocol)


def _nearby(field: ArrayField, scene: Scene, settings: EvaluationConfig, proven_rate: float | None) -> Evaluation:
    deviation = settings.nearby_spread * scene.tight.diagonal
    starts = nearby_starts(scene.start, settings.nearby_starts, deviation, settings.seed)
    # exact, or the bound would be held against the solver's errors; it is of motions that remember the same start
    exact = field.exact().forgetful()
    return judge_nearby(exact.roll, exact.to_claimed, starts, scene.time_s, proven_rate)


def _manifold_starts(field: ArrayField, skill: Skill, scene: Scene, settings: EvaluationConfig) -> Evaluation:
    deviation = settings.nearby_spread * scene.tight.diagonal
    starts = nearby_starts(scene.start, settings.nearby_starts, deviation, settings.seed)
    return judge_manifold_starts(field, starts, scene.time_s, state_unit(skill.state_channels))


def _goal(field: ArrayField, scene: Scene, settings: EvaluationConfig, goal: NDArray[np.float64]) -> Evaluation:
    starts = sample_box(scene.box, _starts_per_axis(settings), settings.seed)
    times_s = np.linspace(0.0, settings.goal_duration * scene.duration_s, settings.region_steps)
    return judge_goal(field.roll, goal, starts, times_s, settings.goal_tolerance * scene.tight.diagonal)


def _pushes(
    field: ArrayField, skill: Skill, judged: Sequence[Judged], settings: EvaluationConfig, proven_rate: float | None
) -> Evaluation:
    """Only of states that begin with a position in space."""
    if BODY_STATES.get(skill.state_channels) != field.field.dim or field.is_plan:
        return Evaluation()
    pushes, duration_s = settings.pushes, skill.geometry.duration_s
    protocol = PushProtocol(pushes.count, pushes.size_m, pushes.at, duration_s, settings.seed)
    rate = proven_rate if field.field.is_onto else None  # pushes leave the manifold, beside which nothing is proven
    return judge_pushes(field, np.stack([one.states[0] for one in judged]), protocol, rate)


def _picture(field: ArrayField, scene: Scene) -> Evaluation:
    if scene.box.dim != 2 or field.is_plan:
        return Evaluation()
    points = sample_box(scene.box, PICTURE_POINTS_PER_AXIS, seed=0).points
    return Evaluation(arrays={"field_points": points, "field_velocity": field.velocity(points)})


def _names(skill: Skill, demonstrations: Demonstrations) -> Evaluation:
    """What coordinates are called where they are joints, and what follows these."""
    if not skill.joints:
        return Evaluation()
    known = demonstrations.joint_names or [f"joint {number + 1}" for number in range(skill.joints)]
    joints = [f"{name.removesuffix('_joint')} [rad]" for name in known]
    return Evaluation(arrays={"state_names": np.array([*joints, *(POSE_NAMES if skill.pose is not None else ())])})


def _starts_per_axis(settings: EvaluationConfig) -> int:
    return max(2, round(math.sqrt(settings.region_starts)))
