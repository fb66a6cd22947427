"""Plan a motion between two poses, through others, around obstacles."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Bool

from geomotion.config import EndEffectorFrame, MetricConfig, ObstacleConfig, PlanningConfig, ToolShape
from geomotion.demos import storage
from geomotion.demos.demonstrations import Demonstrations
from geomotion.figures.latent_scene import save_latent_scene
from geomotion.figures.plan import save_plan_figure
from geomotion.figures.plan_picture import ObstacleShape, PlanPicture
from geomotion.figures.scene3d import save_scene
from geomotion.files import atomic, write_json
from geomotion.obstacles.motion import MovingBody
from geomotion.planning.ends import Query
from geomotion.planning.plan import Plan, PlanStatus
from geomotion.planning.planner import Planner
from geomotion.robot.path_check import PathCheck
from geomotion.scores.configurations import ConfigurationPath
from geomotion.scores.paths import MotionPath
from geomotion.stages import planners
from geomotion.stages.drawn_arm import drawn_arm
from geomotion.stages.graph import LATENT_SCENE, Skilled, load_skilled
from geomotion.stages.outline import outline
from geomotion.stages.path_checks import check_rows, checked
from geomotion.stages.scene import moving_bodies
from geomotion.stages.states import state_paths
from geomotion.tables import aligned
from geomotion.tracking import Artefacts, StageRun

WAY_POINTS = 9  # of a moving obstacle, in pictures


@dataclass(frozen=True)
class PlanStageConfig:
    """What the plan stage needs.

    Attributes:
        planning: Start, goal and how to get there.
        metric: In which lengths are taken.
        obstacle: What stands in the way.
        frame: Which frame of the arm poses are of.
        file_digests: SHA-256 of the contents of each file that obstacles are read from.
    """

    planning: PlanningConfig
    metric: MetricConfig
    obstacle: ObstacleConfig
    frame: EndEffectorFrame
    file_digests: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Planned:
    """Legs of a motion with what they were planned from."""

    planner: Planner
    places: list[planners.Place]
    queries: list[Query]
    plans: list[Plan]
    bodies: list[MovingBody]
    others: list[tuple[planners.Place, planners.Place, Plan]]
    checks: list[PathCheck | None]

    @property
    def found(self) -> bool:
        """Whether every leg has a path."""
        return all(plan.found for plan in self.plans)


def plan(config: PlanStageConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``plan.json``, ``path.npz`` if there is a path, ``figures/plan`` and the interactive ``scene.html``.

    Where latent space has three dimensions, ``latent.html`` shows the path in it.

    Raises:
        InvalidSetting: If start, goal or obstacles do not fit the skill.
    """
    skilled = load_skilled(inputs, config.metric)
    demonstrations = storage.load(inputs["ingest"].folder)
    planned = make_plans(config, skilled, demonstrations)
    write_json(run.folder / "plan.json", _document(planned) | _settings(config, skilled))
    if planned.found:
        with atomic(run.folder / "path.npz") as temporary:
            np.savez_compressed(temporary, allow_pickle=False, **_arrays(planned))
    picture = _picture(planned, skilled, demonstrations)
    save_plan_figure(picture, run.folder / "figures")
    save_scene(picture, run.folder / "scene.html")
    if picture.maps.dim == 3:
        save_latent_scene(picture.maps, run.folder / LATENT_SCENE, picture.codes, picture.line, picture.closed)


def make_plans(config: PlanStageConfig, skilled: Skilled, demonstrations: Demonstrations) -> Planned:
    """Plan every leg; moving obstacles count where they are at time zero."""
    planner = planners.planner(skilled, config.planning, config.frame)
    places = planners.places(config.planning, skilled, demonstrations, planner)
    bodies = moving_bodies(config.obstacle, places[0].state.position_m.shape[1])
    queries: list[Query] = []
    plans: list[Plan] = []
    for start, goal in pairwise(places):  # one after the other: each leg goes on at the node where the last one ended
        code = planner.surface.grid.nodes[queries[-1].goal][None] if queries else start.code
        queries.append(planner.query(start.state, goal.state, (code, goal.code)))
        plans.append(plan_leg(planner, queries[-1], bodies))
    others = []
    for start, goal in planners.other_pairs(config.planning, skilled, demonstrations, planner):
        query = planner.query(start.state, goal.state, (start.code, goal.code))
        others.append((start, goal, plan_leg(planner, query, bodies)))
    checks: list[PathCheck | None] = [None] * len(plans)
    if skilled.skill.arm is not None:
        plans, checks = checked(plans, skilled.skill.arm, config.planning, bodies)
    return Planned(planner, places, queries, plans, bodies, others, checks)


def plan_leg(planner: Planner, query: Query, bodies: list[MovingBody]) -> Plan:
    """A plan; obstacles that leave no way but across a region without data block it, and are named."""
    found = planner.plan(query, bodies)
    if found.status is not PlanStatus.crosses or not bodies or not planner.plan(query).found:
        return found
    alone = [body.name for body in bodies if planner.plan(query, [one for one in bodies if one is not body]).found]
    names = tuple(alone or planners.names(bodies))
    reason = f"{PlanStatus.blocked.value}: {', '.join(names)}; of what they leave open, {found.reason}"
    return replace(found, status=PlanStatus.blocked, reason=reason, blocking=names)


def plan_table(document: Mapping[str, Any]) -> str:
    """Each leg in lines for people."""
    rows = []
    for leg in [*document["legs"], *document["others"]]:
        rows.append((f"{leg['from']} to {leg['to']}", leg["reason"]))
        scores = leg["scores"]
        if scores is not None:
            clearance = scores["clearance_m"]
            shown = "no obstacle" if clearance is None else f"{1000 * clearance:.1f} mm"
            rows += [
                ("  length", f"{scores['length']:.3g} (graph {scores['graph_length']:.3g})"),
                ("  energy", f"{scores['energy']:.3g} (straight line {scores['line_energy']:.3g})"),
                ("  clearance", shown),
                (
                    "  from the data",
                    f"at most {1000 * scores['apart_m']:.1f} mm, {np.degrees(scores['apart_rad']):.1f} deg",
                ),
                (
                    "  manifold to ends",
                    f"{_residual(scores, 'start')} at the start; {_residual(scores, 'goal')} at the goal",
                ),
            ]
        if leg.get("checks") is not None:
            rows += check_rows(leg["checks"])
    return aligned(rows)


def _residual(scores: Mapping[str, float], end: str) -> str:
    return f"{1000 * scores[f'{end}_residual_m']:.1f} mm, {np.degrees(scores[f'{end}_residual_rad']):.1f} deg"


def joined(plans: list[Plan]) -> tuple[MotionPath, np.ndarray]:
    """States and progress of all legs, one after the other; where two meet, the state stands once."""
    paths = [plan.path for plan in plans if plan.path is not None]
    skip = [0] + [1] * (len(paths) - 1)
    parts = [(path.states[first:], path.progress[first:]) for path, first in zip(paths, skip, strict=True)]
    states = parts[0][0].with_vectors(np.concatenate([one.vectors for one, _ in parts]))
    return states, np.concatenate([progress for _, progress in parts])


def _document(planned: Planned) -> dict[str, Any]:
    ends = zip(planned.places[:-1], planned.places[1:], planned.plans, planned.checks, strict=True)
    legs = [
        {"from": start.name, "to": goal.name, **one.as_dict(), "checks": None if check is None else check.as_dict()}
        for start, goal, one, check in ends
    ]
    return {
        "start": planned.places[0].name,
        "goal": planned.places[-1].name,
        "found": planned.found,
        "legs": legs,
        "others": [{"from": start.name, "to": goal.name, **one.as_dict()} for start, goal, one in planned.others],
        "obstacles": planners.names(planned.bodies),
        "cap_m": planned.planner.settings.cap_m,
        "cap_rad": planned.planner.settings.cap_rad,
    }


def _settings(config: PlanStageConfig, skilled: Skilled) -> dict[str, Any]:
    """What was read, and of what the clearance is, in words."""
    protected = "the tool"
    if skilled.skill.arm is not None:
        protected = "the joints" if config.planning.tool is ToolShape.point else "every link of the arm"
    return {"obstacle_files": dict(config.file_digests), "protected": protected}


def _arrays(planned: Planned) -> dict[str, np.ndarray]:
    states, progress = joined(planned.plans)
    codes = [one.codes for one in planned.plans]
    joints = {"joints_rad": states.joints_rad} if isinstance(states, ConfigurationPath) else {}
    return joints | {
        "position_m": states.position_m,
        "orientation": states.orientation,
        "progress": progress,
        "codes": np.concatenate([codes[0], *(one[1:] for one in codes[1:])]),
        "leg": np.concatenate([np.full(len(one) - (number > 0), number) for number, one in enumerate(codes)]),
    }


def _picture(planned: Planned, skilled: Skilled, demonstrations: Demonstrations) -> PlanPicture:
    planner, plans = planned.planner, [*planned.plans, *(one for _, _, one in planned.others)]
    found = [one for one in plans if one.path is not None]
    lines = [np.linspace(one.codes[0], one.codes[-1], len(one.codes)) for one in found]
    paths = [one.path.states for one in found if one.path is not None]
    shown = state_paths(demonstrations, skilled.skill.config.points, skilled.skill.arm)
    names = list(dict.fromkeys(demonstrations.groups))
    groups = [names.index(group) for group in demonstrations.groups]
    trained = {groups[number]: shown[number] for number in reversed(skilled.skill.train_demos)}
    return PlanPicture(
        maps=skilled.latent_maps(planner.settings.cap_m, planner.settings.cap_rad),
        codes=[one.codes for one in found],
        line=lines,
        closed=_taken(planned).reshape(skilled.surface.grid.shape) if planned.bodies else None,
        demonstrations=shown,
        held_out=list(skilled.skill.test_demos),
        groups=groups,
        paths=paths,
        line_paths=[planner.manifold.decode(line).states for line in lines],
        obstacles=[_shape(body) for body in planned.bodies],
        arm=None if skilled.skill.arm is None else drawn_arm(skilled.skill.arm, paths, trained),
    )


def _taken(planned: Planned) -> Bool[np.ndarray, " node"]:
    """Nodes that obstacles close; under a soft constraint, where they add more than half of the gain to the metric."""
    planner, query, constraint = planned.planner, planned.queries[-1], planned.planner.settings.constraint
    planner.sense(query, planned.bodies, 0.0)
    if constraint.hard:
        return np.asarray(query.is_open & ~planner.graph.is_free(np.arange(planner.graph.nodes)))
    return np.asarray(query.is_open & (planner.graph.factor > 1 + constraint.gain / 2).any(axis=0))


def _shape(body: MovingBody) -> ObstacleShape:
    vertices, faces = outline(body.body)
    last = getattr(body.motion, "times_s", np.array([0.0, 1.0]))[-1]
    way = np.stack([body.motion.offset(float(time_s)) for time_s in np.linspace(0.0, last, WAY_POINTS)])
    return ObstacleShape(
        body.name, vertices + way[0], faces, way - way[0] if np.ptp(way, axis=0).any() else way[:1] * 0
    )
