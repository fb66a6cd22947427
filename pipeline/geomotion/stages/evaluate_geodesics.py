"""Judge a manifold: geodesics between the ends of demonstrations, beside the demonstrations themselves."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from geomotion.config import (
    EndEffectorFrame,
    GeodesicEvaluationConfig,
    MetricConfig,
    NoObstacle,
    ObstacleConfig,
    PlanningConfig,
)
from geomotion.demos import storage
from geomotion.figures.arm_failures import save_failures_figure
from geomotion.figures.geodesics import JudgedGeodesic, save_geodesics_figure
from geomotion.figures.methods import save_methods_figure
from geomotion.files import atomic, write_json
from geomotion.planning.carrying import carried_to
from geomotion.planning.ends import Query
from geomotion.planning.plan import Plan
from geomotion.planning.planner import Planner
from geomotion.scores.configurations import (
    ConfigurationPath,
    joint_dtwd,
    mean_configurations_with_blended_ends,
)
from geomotion.scores.evaluation import Evaluation, Unit, combine
from geomotion.scores.paths import (
    MotionPath,
    PosePath,
    dimensionless_jerk,
    mean_path_with_blended_ends,
    pose_dtwd,
    turning_rad,
)
from geomotion.scores.score import Score, max_score, mean_score, share_score
from geomotion.scores.switching import group_switches
from geomotion.scores.table import scores_table
from geomotion.stages import planners
from geomotion.stages.arm_failures import study_arm_failures
from geomotion.stages.drawn_arm import joint_axes
from geomotion.stages.graph import Skilled, load_skilled
from geomotion.stages.methods import compare_methods
from geomotion.stages.states import state_paths
from geomotion.tracking import Artefacts, StageRun

__all__ = ["EvaluateGeodesicsConfig", "evaluate_geodesics", "scores_table"]

MM = 1000.0
UNITS = {"position": Unit("mm", MM), "orientation": Unit("rad"), "joint": Unit("rad")}
ALIKE = {
    "position": 1e-4,
    "orientation": 1e-3,
    "joint": 1e-3,
}  # [m, rad]; demonstrations that differ less set no measure


@dataclass(frozen=True)
class EvaluateGeodesicsConfig:
    """What the evaluate stage of `gms` needs.

    Attributes:
        evaluation: What is judged.
        planning: How to plan.
        metric: In which lengths are taken.
        frame: Which frame of the arm poses are of.
        obstacle: Beside the arm, where its failures are studied; geodesics are judged in free space.
        file_digests: SHA-256 of the contents of each file that obstacles are read from.
    """

    evaluation: GeodesicEvaluationConfig
    planning: PlanningConfig
    metric: MetricConfig
    frame: EndEffectorFrame
    obstacle: ObstacleConfig = field(default_factory=NoObstacle)
    file_digests: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Judged:
    """One demonstration and what stands in for it.

    Attributes:
        number: Of the demonstration.
        demonstration: Its states.
        plan: From its first to its last state.
        averaged: Mean of the training demonstrations, brought to its ends.
        line: Decoded straight latent line, brought to its ends; None without a plan.
        others: Training demonstrations other than itself; itself, where it is the only one.
    """

    number: int
    demonstration: MotionPath
    plan: Plan
    averaged: MotionPath
    line: MotionPath | None
    others: list[MotionPath]

    @property
    def geodesic(self) -> MotionPath | None:
        """The planned path."""
        return None if self.plan.path is None else self.plan.path.states

    @cached_property
    def unlike_others(self) -> dict[str, float]:
        """Mean DTWD between this demonstration and the others [m, rad], by part; not a number where they are alike."""
        apart = [dtwd(self.demonstration, other) for other in self.others]
        means = {part: float(np.mean([one[part] for one in apart])) for part in apart[0]}
        return {part: mean if mean > ALIKE[part] else np.nan for part, mean in means.items()}

    def ratio(self, path: MotionPath) -> dict[str, float]:
        """DTWD of a path, over the mean DTWD between this demonstration and the others, by part."""
        own = dtwd(path, self.demonstration)
        return {part: own[part] / mean for part, mean in self.unlike_others.items()}


def evaluate_geodesics(config: EvaluateGeodesicsConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``scores.json``, ``evaluation.npz`` and the picture.

    Held-out demonstrations are judged; where there are none, those that were trained on.
    """
    skilled = load_skilled(inputs, config.metric)
    demonstrations = storage.load(inputs["ingest"].folder)
    planner = planners.planner(skilled, config.planning, config.frame)
    paths = state_paths(demonstrations, config.evaluation.samples, skilled.skill.arm)
    training = [paths[number] for number in skilled.skill.train_demos]
    numbers = skilled.skill.test_demos or skilled.skill.train_demos
    subset = "heldout" if skilled.skill.test_demos else "train"
    same_group = [_comrades(skilled, demonstrations.groups, number) for number in numbers]
    judged = [
        judge(planner, number, paths[number], [paths[one] for one in others])
        for number, others in zip(numbers, same_group, strict=True)
    ]
    evaluation = combine(
        [
            score(planner, judged, subset),
            switching(judged, skilled, subset),
            pairs(planner, demonstrations.groups, skilled, paths),
        ]
    )
    if config.evaluation.compare_methods:
        compared = compare_methods(skilled, config.planning, config.frame, paths[numbers[0]])
        evaluation = combine([evaluation, compared.evaluation])
        maps = skilled.latent_maps(planner.settings.cap_m, planner.settings.cap_rad)
        if maps.dim == 2:
            save_methods_figure(compared.curves, maps, run.folder / "figures")
    if config.evaluation.arm_failures.study:
        caps = planner.settings.cap_m, planner.settings.cap_rad
        study = study_arm_failures(config.evaluation.arm_failures, skilled, config.obstacle, config.frame, caps)
        evaluation = combine([evaluation, study.evaluation])
        save_failures_figure(study.failures, skilled.latent_maps(*caps), run.folder / "figures")
    write_json(
        run.folder / "scores.json", evaluation.document("geodesics between ends of demonstrations", demonstrations.name)
    )
    with atomic(run.folder / "evaluation.npz") as temporary:
        np.savez_compressed(temporary, allow_pickle=False, **evaluation.arrays)
    run.log_scores(evaluation.scores)
    joints = None if skilled.skill.arm is None else joint_axes(skilled.skill.arm)
    save_geodesics_figure([_drawn(one) for one in judged], training, run.folder / "figures", joints)


def dtwd(path: MotionPath, other: MotionPath) -> dict[str, float]:
    """DTWD per point of every part: position [m], orientation [rad], and joints [rad] if the paths have them."""
    pose = pose_dtwd(path, other)
    joints = {}
    if isinstance(path, ConfigurationPath) and isinstance(other, ConfigurationPath):
        joints = {"joint": joint_dtwd(path, other)}
    return {"position": pose.position, "orientation": pose.orientation} | joints


def judge(planner: Planner, number: int, demonstration: MotionPath, others: list[MotionPath]) -> Judged:
    """Plan from the first to the last state of a demonstration, and make what the plan is compared with."""
    query = planner.query(demonstration[:1], demonstration[-1:])
    plan = planner.plan(query)
    averaged = _averaged(others, demonstration)
    return Judged(number, demonstration, plan, averaged, straight_line(planner, query, plan), others)


def _averaged(others: Sequence[MotionPath], like: MotionPath) -> MotionPath:
    """The mean of some demonstrations, brought to the ends of another one."""
    start, goal = like[:1], like[-1:]
    if isinstance(start, ConfigurationPath) and isinstance(goal, ConfigurationPath):
        configurations = [one for one in others if isinstance(one, ConfigurationPath)]
        return mean_configurations_with_blended_ends(configurations, start, goal, len(like))
    poses = [PosePath(one.position_m, one.orientation) for one in (start, goal, *others)]
    return mean_path_with_blended_ends(poses[2:], poses[0], poses[1], len(like))


def straight_line(planner: Planner, query: Query, plan: Plan) -> MotionPath | None:
    """The decoded straight latent line between the ends of a plan, brought to the same states."""
    if plan.path is None:
        return None
    decoded = planner.manifold.decode(np.linspace(plan.codes[0], plan.codes[-1], len(plan.codes)))
    return carried_to(decoded.states, query.ends, decoded.progress, query.offsets)


def score(planner: Planner, judged: Sequence[Judged], subset: str) -> Evaluation:
    """All scores of some judged demonstrations.

    Args:
        planner: With the demonstrated poses.
        judged: Demonstrations with their plans.
        subset: First part of the scores' names.
    """
    planned = [one for one in judged if one.geodesic is not None]
    scores: dict[str, Score] = {"planned_share": share_score([one.plan.found for one in judged], "a path was found")}
    omitted = {f"{subset}.demonstration {one.number}": one.plan.reason for one in judged if one.geodesic is None}
    if planned:
        scores |= _reproduction(planned) | _support(planner, planned) | _geometry(planned)
        omitted |= {
            f"{subset}.{part}_dtwd_ratio": f"the demonstrations do not differ in {part}"
            for part in planned[0].unlike_others
            if f"{part}_dtwd_ratio" not in scores
        }
    arrays = {}
    for one in planned:
        for name, path in (("demo", one.demonstration), ("geodesic", one.geodesic), ("averaged", one.averaged)):
            assert path is not None
            arrays[f"{name}_{one.number}_position_m"] = path.position_m
            arrays[f"{name}_{one.number}_orientation"] = path.orientation
            if isinstance(path, ConfigurationPath):
                arrays[f"{name}_{one.number}_joints_rad"] = path.joints_rad
    return Evaluation({f"{subset}.{name}": found for name, found in scores.items()}, arrays, omitted)


def switching(judged: Sequence[Judged], skilled: Skilled, subset: str) -> Evaluation:
    """How often geodesics change between groups of demonstrations, where there are several."""
    data = skilled.manifold.data
    paths = [one.geodesic for one in judged if one.geodesic is not None]
    if len(set(data.groups)) < 2 or not paths:
        return Evaluation()
    counts = [float(group_switches(path, data.originals, data.groups)) for path in paths]
    note = "changes of the group of the nearest demonstrated state"
    return Evaluation({f"{subset}.group_switches": mean_score(counts, "1", note)})


def pairs(planner: Planner, groups: Sequence[str], skilled: Skilled, paths: Sequence[MotionPath]) -> Evaluation:
    """From the start of every group of training demonstrations to the goal of every one, shown or not (Sec. 3.6.2)."""
    first = {groups[number]: number for number in reversed(skilled.skill.train_demos)}
    if len(first) < 2:
        return Evaluation()
    plans = {
        (start, goal): planner.plan(planner.query(paths[first[start]][:1], paths[first[goal]][-1:]))
        for start in sorted(first)
        for goal in sorted(first)
    }
    omitted = {f"pairs.{start} to {goal}": plan.reason for (start, goal), plan in plans.items() if not plan.found}
    note = f"of {len(first)} starts with {len(first)} goals; {len(first)} pairs were demonstrated"
    return Evaluation({"pairs.planned_share": share_score([plan.found for plan in plans.values()], note)}, {}, omitted)


def _reproduction(planned: Sequence[Judged]) -> dict[str, Score]:
    rows = [one.geodesic for one in planned]
    distances = [dtwd(path, one.demonstration) for path, one in zip(rows, planned, strict=True) if path is not None]
    scores = {
        f"{part}_dtwd_per_point": mean_score(
            [UNITS[part].per_state_unit * one[part] for one in distances], UNITS[part].name, "sum of two means"
        )
        for part in distances[0]
    }
    kinds: dict[str, tuple[list[MotionPath | None], str]] = {
        "": ([one.geodesic for one in planned], "over the mean DTWD from the demonstration to the training ones"),
        "_of_averaged_demo": (
            [one.averaged for one in planned],
            "baseline: mean of the training demonstrations, ends blended",
        ),
        "_of_straight_line": ([one.line for one in planned], "baseline: straight latent line, ends blended"),
    }
    for suffix, (paths, note) in kinds.items():
        ratios = [one.ratio(path) for one, path in zip(planned, paths, strict=True) if path is not None]
        for part in distances[0]:
            values = [one[part] for one in ratios if np.isfinite(one[part])]
            if values:
                scores[f"{part}_dtwd_ratio{suffix}"] = mean_score(values, "1", note)
    return scores


def _support(planner: Planner, planned: Sequence[Judged]) -> dict[str, Score]:
    settings = planner.settings
    found = [one.plan.scores for one in planned if one.plan.scores is not None]
    demos = [planner.support.distances(one.demonstration) for one in planned]
    shares = [
        planner.support.share_within(one.geodesic.position_m, settings.cap_m)
        for one in planned
        if one.geodesic is not None
    ]
    note = "largest distance of a pose to the nearest demonstrated one"
    return {
        "farthest_from_data": max_score([MM * one.apart_m for one in found], "mm", note),
        "farthest_from_data_of_demo": max_score(
            [MM * float(apart.max()) for apart, _ in demos], "mm", "the demonstration itself"
        ),
        "farthest_turn_from_data": max_score(
            [one.apart_rad for one in found], "rad", "to orientations demonstrated nearby"
        ),
        "farthest_turn_from_data_of_demo": max_score(
            [float(turn.max()) for _, turn in demos], "rad", "the demonstration itself"
        ),
        "share_in_support": mean_score(
            shares, "1", f"of positions within {MM * settings.cap_m:.0f} mm of a demonstrated one"
        ),
    }


def _geometry(planned: Sequence[Judged]) -> dict[str, Score]:
    found = [one.plan.scores for one in planned if one.plan.scores is not None]
    paths = [one.geodesic for one in planned if one.geodesic is not None]
    demos = [one.demonstration for one in planned]
    return {
        "energy": mean_score([one.energy for one in found], "1", "in the thesis' metric"),
        "energy_of_straight_line": mean_score(
            [one.line_energy for one in found], "1", "baseline: straight latent line"
        ),
        "start_residual": mean_score(
            [MM * one.start_residual_m for one in found], "mm", "manifold to wanted start, bridged"
        ),
        "goal_residual": mean_score(
            [MM * one.goal_residual_m for one in found], "mm", "manifold to wanted goal, bridged"
        ),
        "turning": mean_score([turning_rad(path.position_m) for path in paths], "rad", "of the position path, at 1 cm"),
        "turning_of_demo": mean_score(
            [turning_rad(path.position_m) for path in demos], "rad", "the demonstration itself"
        ),
        "jerk": mean_score(
            [dimensionless_jerk(path.position_m) for path in paths], "1", "dimensionless, of the position path"
        ),
    }


def _comrades(skilled: Skilled, groups: tuple[str, ...], number: int) -> list[int]:
    """Other training demonstrations of the same group; of all groups, where it has none; itself, if it is alone."""
    own = [one for one in skilled.skill.train_demos if groups[one] == groups[number] and one != number]
    return own or [one for one in skilled.skill.train_demos if one != number] or [number]


def _drawn(one: Judged) -> JudgedGeodesic:
    averaged = one.ratio(one.averaged)
    ratio = dict.fromkeys(averaged, np.nan) if one.geodesic is None else one.ratio(one.geodesic)
    return JudgedGeodesic(one.number, one.demonstration, one.geodesic, one.averaged, one.line, ratio, averaged)
