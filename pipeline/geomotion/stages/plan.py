"""Plan a motion between two poses, through others, around obstacles."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from geomotion.config import EndEffectorFrame, MetricConfig, ObstacleConfig, PlanningConfig
from geomotion.demos import storage
from geomotion.demos.demonstrations import Demonstrations
from geomotion.demos.poses import pose_paths
from geomotion.figures.plan import ObstacleShape, PlanPicture, save_plan_figure
from geomotion.figures.scene3d import save_scene
from geomotion.files import atomic, write_json
from geomotion.obstacles.motion import MovingBody
from geomotion.planning.plan import Plan, PlanStatus
from geomotion.planning.planner import Planner, Query
from geomotion.scores.paths import PosePath
from geomotion.stages import planners
from geomotion.stages.graph import Skilled, load_skilled
from geomotion.stages.outline import outline
from geomotion.stages.scene import moving_bodies
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
        frame: Which frame of the arm the poses are of.
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

    @property
    def found(self) -> bool:
        """Whether every leg has a path."""
        return all(plan.found for plan in self.plans)


def plan(config: PlanStageConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``plan.json``, ``path.npz`` if there is a path, ``figures/plan`` and the interactive ``scene.html``.

    Raises:
        InvalidSetting: If start, goal or obstacles do not fit the skill.
    """
    skilled = load_skilled(inputs, config.metric)
    demonstrations = storage.load(inputs["ingest"].folder)
    planned = make_plans(config, skilled, demonstrations)
    write_json(run.folder / "plan.json", _document(planned) | {"obstacle_files": dict(config.file_digests)})
    if planned.found:
        with atomic(run.folder / "path.npz") as temporary:
            np.savez_compressed(temporary, allow_pickle=False, **_arrays(planned))
    picture = _picture(planned, skilled, demonstrations)
    save_plan_figure(picture, run.folder / "figures")
    save_scene(picture, run.folder / "scene.html")


def make_plans(config: PlanStageConfig, skilled: Skilled, demonstrations: Demonstrations) -> Planned:
    """Plan every leg; moving obstacles count where they are at time zero."""
    planner = planners.planner(skilled, config.planning, config.frame)
    places = planners.places(config.planning, skilled, demonstrations, planner)
    bodies = moving_bodies(config.obstacle, skilled.skill.geometry.position_dim)
    queries: list[Query] = []
    plans: list[Plan] = []
    for start, goal in pairwise(places):  # one after the other: each leg goes on at the node where the last one ended
        code = planner.surface.grid.nodes[queries[-1].goal][None] if queries else start.code
        queries.append(planner.query(start.pose, goal.pose, (code, goal.code)))
        plans.append(plan_leg(planner, queries[-1], bodies))
    others = []
    for start, goal in planners.other_pairs(config.planning, skilled, demonstrations, planner):
        query = planner.query(start.pose, goal.pose, (start.code, goal.code))
        others.append((start, goal, plan_leg(planner, query, bodies)))
    return Planned(planner, places, queries, plans, bodies, others)


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
    return aligned(rows)


def _residual(scores: Mapping[str, float], end: str) -> str:
    return f"{1000 * scores[f'{end}_residual_m']:.1f} mm, {np.degrees(scores[f'{end}_residual_rad']):.1f} deg"


def joined(plans: list[Plan]) -> tuple[PosePath, np.ndarray]:
    """Poses and progress of all legs, one after the other; where two meet, the pose stands once."""
    paths = [plan.path for plan in plans if plan.path is not None]
    skip = [0] + [1] * (len(paths) - 1)
    parts = [(path.poses[first:], path.progress[first:]) for path, first in zip(paths, skip, strict=True)]
    poses = PosePath(
        np.concatenate([one.position_m for one, _ in parts]), np.concatenate([one.orientation for one, _ in parts])
    )
    return poses, np.concatenate([progress for _, progress in parts])


def _document(planned: Planned) -> dict[str, Any]:
    ends = zip(planned.places[:-1], planned.places[1:], planned.plans, strict=True)
    legs = [{"from": start.name, "to": goal.name, **one.as_dict()} for start, goal, one in ends]
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


def _arrays(planned: Planned) -> dict[str, np.ndarray]:
    poses, progress = joined(planned.plans)
    codes = [one.codes for one in planned.plans]
    return {
        "position_m": poses.position_m,
        "orientation": poses.orientation,
        "progress": progress,
        "codes": np.concatenate([codes[0], *(one[1:] for one in codes[1:])]),
        "leg": np.concatenate([np.full(len(one) - (number > 0), number) for number, one in enumerate(codes)]),
    }


def _picture(planned: Planned, skilled: Skilled, demonstrations: Demonstrations) -> PlanPicture:
    planner, plans = planned.planner, [*planned.plans, *(one for _, _, one in planned.others)]
    found = [one for one in plans if one.path is not None]
    lines = [np.linspace(one.codes[0], one.codes[-1], len(one.codes)) for one in found]
    cap = planner.settings.cap_m, planner.settings.cap_rad
    maps = skilled.latent_maps(*cap)
    closed = None
    if maps is not None and planned.bodies:
        planner.search(planned.queries[-1], planned.bodies, 0.0, 0.0)
        taken = ~planner.graph.is_free(np.arange(planner.graph.nodes))
        closed = (taken & planned.queries[-1].is_open).reshape(skilled.surface.grid.shape)
    names = list(dict.fromkeys(demonstrations.groups))
    return PlanPicture(
        maps=maps,
        codes=[one.codes for one in found],
        line=lines,
        closed=closed,
        demonstrations=pose_paths(demonstrations, skilled.skill.config.points),
        held_out=list(skilled.skill.test_demos),
        groups=[names.index(group) for group in demonstrations.groups],
        paths=[one.path.poses for one in found if one.path is not None],
        line_paths=[planner.manifold.decode(line).poses for line in lines],
        obstacles=[_shape(body) for body in planned.bodies],
    )


def _shape(body: MovingBody) -> ObstacleShape:
    vertices, faces = outline(body.body)
    last = getattr(body.motion, "times_s", np.array([0.0, 1.0]))[-1]
    way = np.stack([body.motion.offset(float(time_s)) for time_s in np.linspace(0.0, last, WAY_POINTS)])
    return ObstacleShape(
        body.name, vertices + way[0], faces, way - way[0] if np.ptp(way, axis=0).any() else way[:1] * 0
    )
