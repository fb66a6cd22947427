"""Planners from configuration and artefacts: which start and goal, which obstacles, which limits."""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float

from geomotion import arms
from geomotion import config as schema
from geomotion.demos.demonstrations import Demonstrations
from geomotion.errors import InvalidSetting
from geomotion.obstacles.motion import MovingBody
from geomotion.planning.obstruction import Constraint, RobotShape, Tool
from geomotion.planning.planner import Planner, PlannerSettings
from geomotion.robot import panda
from geomotion.robot.arm import EXCESS_M
from geomotion.robot.body import BodyPoints
from geomotion.robot.whole_arm import WholeArm
from geomotion.scores.configurations import ConfigurationPath
from geomotion.scores.paths import QUATERNION, MotionPath, PosePath
from geomotion.stages.graph import Skilled
from geomotion.stages.states import state_paths

UNIT_TOLERANCE = 0.01
CLOSER_EXCESS_M = 0.006  # of the balls around an arm where larger ones come too close


@dataclass(frozen=True)
class Place:
    """Where a path begins or ends.

    Attributes:
        name: For people.
        state: One state.
        code: Its latent point, if that is what was asked for, shape (1, d).
    """

    name: str
    state: MotionPath
    code: Float[np.ndarray, "1 d"] | None = None


def planner(
    skilled: Skilled, config: schema.PlanningConfig, frame: schema.EndEffectorFrame, horizon_s: float = 0.0
) -> Planner:
    """A planner with the limits of the demonstrations, and what the configuration adds to them.

    Args:
        skilled: Trained manifold and its grid.
        config: Limits, tool and constraint.
        frame: Which frame of the arm poses are of.
        horizon_s: How far ahead moving obstacles are looked at [s].
    """
    limits, manifold = skilled.limits, skilled.manifold
    settings = PlannerSettings(
        cap_m=limits["cap_m"] + config.leave_data_m,
        cap_rad=limits["cap_rad"] + config.leave_data_rad,
        end_cap_m=limits["end_cap_m"] + config.leave_data_m,
        end_cap_rad=limits["end_cap_rad"] + config.leave_data_rad,
        shape=_shape(skilled, config, frame),
        constraint=Constraint(
            config.clearance_m,
            config.constraint is not schema.ConstraintKind.soft,
            0.0 if config.constraint is schema.ConstraintKind.hard else config.obstacle_gain,
            horizon_s,
        ),
        control_points=config.spline_control_points,
        samples=config.samples,
        refine_steps=config.refine_steps,
        closes_edges=skilled.skill.arm is None,
        crossing_length=limits["crossing_length"],
    )
    support = manifold.space.support(manifold.data.originals)
    return Planner(manifold, skilled.surface, support, manifold.anchors(0), manifold.anchors(-1), settings)


def places(
    config: schema.PlanningConfig, skilled: Skilled, demonstrations: Demonstrations, planner: Planner
) -> list[Place]:
    """Start, places on the way, and goal.

    Raises:
        InvalidSetting: If one of them is not well written, or names a demonstration that does not exist.
    """
    judged = (*skilled.skill.test_demos, *skilled.skill.train_demos)[0]
    start = f"demo:{judged}" if config.start is None else config.start
    goal = f"demo:{judged}" if config.goal is None else config.goal
    paths = state_paths(demonstrations, skilled.skill.config.points, skilled.skill.arm)
    wanted = [("start", start, 0), *(("via", one, -1) for one in config.via), ("goal", goal, -1)]
    return [_place(key, value, end, paths, planner) for key, value, end in wanted]


def other_pairs(
    config: schema.PlanningConfig, skilled: Skilled, demonstrations: Demonstrations, planner: Planner
) -> list[tuple[Place, Place]]:
    """Further starts and goals."""
    paths = state_paths(demonstrations, skilled.skill.config.points, skilled.skill.arm)
    return [
        (_place("others", start, 0, paths, planner), _place("others", goal, -1, paths, planner))
        for start, goal in config.others
    ]


def _shape(skilled: Skilled, config: schema.PlanningConfig, frame: schema.EndEffectorFrame) -> RobotShape:
    if skilled.skill.arm is not None:
        return _whole_arm(skilled.skill.arm, config, skilled.skill.config.points_between_joints)
    held = np.zeros((1, 3)), np.array([config.tool_radius_m])
    if config.tool is not schema.ToolShape.hand:
        return Tool(*held)
    first = skilled.manifold.data.paths[0]
    if (first.position_m.shape[1], first.orientation.shape[1]) != (3, QUATERNION):
        raise InvalidSetting("planning.tool", config.tool.value, "point: a hand needs poses in R3 x S3")
    hand = panda.hand_balls(frame.value)
    return Tool(*(np.concatenate([one, other]) for one, other in zip(hand, held, strict=True)))


def _whole_arm(config: schema.ArmConfig, planning: schema.PlanningConfig, between: int) -> WholeArm:
    """All links, and a ball around what the hand holds; or nothing but the points that the metric is taken of."""
    arm = arms.build(config)
    points = arm.joint_points(between)
    if planning.tool is schema.ToolShape.point:
        radii_m = np.where(np.arange(len(points)) == len(points) - 1, planning.tool_radius_m, 0.0)
        return WholeArm.of(arm, replace(points, radius_m=radii_m), points)
    tip = slice(len(points) - 1, None)

    def balls(excess_m: float) -> BodyPoints:
        cover = arm.cover(excess_m)
        if planning.tool_radius_m == 0:
            return cover
        return BodyPoints(
            np.concatenate([cover.frame, points.frame[tip]]),
            np.concatenate([cover.offset_m, points.offset_m[tip]]),
            np.append(cover.radius_m, planning.tool_radius_m),
        )

    return WholeArm.of(arm, balls(EXCESS_M), points, closer=partial(balls, CLOSER_EXCESS_M))


def _place(key: str, value: Any, end: int, paths: list[MotionPath], planner: Planner) -> Place:
    match value:
        case str() if value.startswith("demo:"):
            number = _number(key, value, value.removeprefix("demo:"), len(paths))
            which = "start" if end == 0 else "end"
            path = paths[number]
            return Place(f"{which} of demonstration {number}", path[:1] if end == 0 else path[-1:])
        case str() if value.startswith("antipode:"):
            number = _number(key, value, value.removeprefix("antipode:"), len(paths))
            return _antipode(key, value, number, end, paths[number], planner)
        case str() if value.startswith("latent:"):
            code = np.array([_float(key, value, part) for part in value.removeprefix("latent:").split(":")])
            if len(code) != planner.manifold.latent_dim or not planner.surface.grid.contains(code[None]).all():
                raise InvalidSetting(f"planning.{key}", value, _latent_box(planner))
            return Place(f"latent point {np.round(code, 3).tolist()}", planner.state_at(code), code[None])
        case list():
            if isinstance(paths[0], ConfigurationPath):
                return Place("given configuration", _configuration(key, value, paths[0]))
            return Place("given pose", _pose(key, value, paths[0]))
    raise InvalidSetting(
        f"planning.{key}", value, "demo:N, latent:A:B, or a pose such as [0.4,0,0.3,0,1,0,0], or joint positions [rad]"
    )


def _antipode(key: str, value: str, number: int, end: int, path: MotionPath, planner: Planner) -> Place:
    """The end of a demonstration with the other sign of its orientation, in the other cluster."""
    if not planner.manifold.shows_both_signs:  # type: ignore[attr-defined]
        raise InvalidSetting(f"planning.{key}", value, "a manifold trained with manifold.antipodal=doubled")
    which = slice(0, 1) if end == 0 else slice(-1, None)
    pose = PosePath(path.position_m[which], -path.orientation[which])
    name = f"{'start' if end == 0 else 'end'} of demonstration {number} with -q"
    return Place(name, pose, planner.manifold.encode(pose, float(end != 0)))  # type: ignore[attr-defined]


def _number(key: str, value: str, text: str, count: int) -> int:
    number = int(text) if text.isdigit() else -1
    if not 0 <= number < count:
        raise InvalidSetting(f"planning.{key}", value, f"demo:0 to demo:{count - 1}")
    return number


def _float(key: str, value: str, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise InvalidSetting(f"planning.{key}", value, "numbers between the colons, such as latent:0.5:-1") from error


def _configuration(key: str, values: list[Any], like: ConfigurationPath) -> ConfigurationPath:
    count = like.joints_rad.shape[1]
    if len(values) != count or not all(isinstance(value, int | float) and np.isfinite(value) for value in values):
        raise InvalidSetting(f"planning.{key}", values, f"{count} joint positions [rad]")
    return like.with_vectors(np.asarray(values, dtype=float)[None])


def _pose(key: str, values: list[Any], like: MotionPath) -> PosePath:
    dims = like.position_m.shape[1], like.orientation.shape[1]
    kind = "quaternion wxyz" if dims[1] == 4 else "vector"
    expected = f"{sum(dims)} numbers: {dims[0]} of the position [m], {dims[1]} of a unit {kind}"
    if len(values) != sum(dims) or not all(isinstance(value, int | float) for value in values):
        raise InvalidSetting(f"planning.{key}", values, expected)
    pose = np.asarray(values, dtype=float)
    length = float(np.linalg.norm(pose[dims[0] :]))
    if not np.isfinite(pose).all() or abs(length - 1) > UNIT_TOLERANCE:
        raise InvalidSetting(f"planning.{key}", values, f"{expected}; its length is {length:.3g}")
    return PosePath(pose[None, : dims[0]], pose[None, dims[0] :] / length)


def _latent_box(planner: Planner) -> str:
    grid = planner.surface.grid
    ends = zip(grid.low, grid.high, strict=True)
    return "latent:" + ":".join(f"{low:.3g}…{high:.3g}" for low, high in ends) + ", inside the latent grid"


def names(bodies: list[MovingBody]) -> list[str]:
    """Names of obstacles, for documents."""
    return [body.name for body in bodies]
