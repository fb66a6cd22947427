"""Execute a planned motion on the simulated Panda."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from geomotion.config import MetricConfig, ObstacleConfig, PlanningConfig, RobotConfig, TimingLaw
from geomotion.demos import storage
from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.errors import InvalidSetting
from geomotion.figures.replay import ReplayPicture, save_replay_figure
from geomotion.files import read_json, write_json
from geomotion.obstacles.motion import MovingBody
from geomotion.robot import panda
from geomotion.robot.chain import panda_chain
from geomotion.robot.closed_loop import closed_loop
from geomotion.robot.film import Film, draw_path
from geomotion.robot.grasp import GraspedCylinder
from geomotion.robot.inverse_kinematics import JointPath, UnreachablePose, solve_path
from geomotion.robot.recording import Tracking
from geomotion.robot.scene import PandaScene
from geomotion.robot.timed import TimedJoints
from geomotion.robot.timing import fastest, like_demonstration
from geomotion.robot.tracking import follow
from geomotion.scores.paths import PosePath
from geomotion.stages.demonstrated_timing import share_of_path_at_time
from geomotion.stages.graph import Skilled, load_skilled
from geomotion.stages.replan import Pilot, make_pilot
from geomotion.stages.scene import moving_bodies, solids
from geomotion.tables import aligned
from geomotion.tracking import Artefacts, StageRun

PATIENCE = 4.0  # times the planned duration, after which a goal that is not reached is given up


@dataclass(frozen=True)
class ReplayStageConfig:
    """What the replay stage needs."""

    robot: RobotConfig
    planning: PlanningConfig
    metric: MetricConfig
    obstacle: ObstacleConfig


@dataclass(frozen=True)
class Planned:
    """A path to execute.

    Attributes:
        path: Poses.
        progress: Share of the demonstrated motion that is done at each of them.
        stops: Rows of start, places on the way, and goal.
    """

    path: PosePath
    progress: Float[np.ndarray, " point"]
    stops: list[int]


@dataclass(frozen=True)
class Replay:
    """What the arm did.

    Attributes:
        tracking: Measured against commanded.
        joints: Inverse kinematics of the planned path.
        timed: The motion that was commanded; of a closed loop, the one planned before it began.
        unreachable: Poses asked for that the arm cannot take: of the path, or of the periods of a closed loop.
        asked: How many poses were asked for.
        pilot: What led a closed loop; None if the path was followed as planned.
        film: Pictures, if they were asked for.
    """

    tracking: Tracking
    joints: JointPath
    timed: TimedJoints
    unreachable: Sequence[UnreachablePose]
    asked: int
    pilot: Pilot | None
    film: Film | None


def replay(config: ReplayStageConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``replay.json``, the executed ``trajectory/``, ``film.gif`` and ``figures/replay``.

    Without a path there is nothing to execute: ``replay.json`` then says so, and the rest is left out.

    Raises:
        InvalidSetting: If the demonstrations are not poses in R³×S³.
    """
    skilled = load_skilled(inputs, config.metric)
    geometry = skilled.skill.geometry
    if (geometry.position_dim, geometry.orientation_dim) != (3, 4):
        found = f"poses in R{geometry.position_dim} x S{geometry.orientation_dim - 1}"
        raise InvalidSetting("dataset", found, "poses in R3 x S3, which a robot can take")
    plan = read_json(inputs["plan"].path("plan.json"))
    if not plan["found"]:
        reasons = [leg["reason"] for leg in plan["legs"] if leg["status"] != "found"]
        write_json(run.folder / "replay.json", {"executed": False, "reason": reasons[0]})
        return
    demonstrations = storage.load(inputs["ingest"].folder)
    done = execute(config, skilled, demonstrations, _planned(inputs["plan"], plan["legs"]))
    write_json(run.folder / "replay.json", _document(config, done))
    trajectory = _trajectory(demonstrations, done, config.robot.frame.value)
    storage.save(trajectory, run.folder / "trajectory")
    if done.film is not None:
        done.film.save(run.folder / "film.gif")
    save_replay_figure(_picture(config, done), run.folder / "figures")


def execute(config: ReplayStageConfig, skilled: Skilled, demonstrations: Demonstrations, planned: Planned) -> Replay:
    """Inverse kinematics, timing, and the motion in the simulator, replanned on the way where something moves."""
    robot, bodies = config.robot, moving_bodies(config.obstacle, 3)
    path, frame = planned.path, _frame(robot)
    joints = solve_path(path.position_m, path.orientation, frame)
    timed = _timed(robot, skilled, demonstrations, joints, planned.progress)
    film = Film(fps=robot.film_fps) if robot.film else None
    motions = {body.name: body.motion.offset for body in bodies}
    with PandaScene(table=robot.table) as scene:
        _furnish(scene, config, bodies, None if film is None else path)
        if not _replans(robot, bodies, timed.duration_s):
            tracking = follow(scene, timed, frame, motions, film)
            return Replay(tracking, joints, timed, joints.unreachable, len(path), None, film)
        pilot = make_pilot(robot, config.planning, skilled, demonstrations, _rows(path, planned.stops), bodies)
        loop = closed_loop(
            scene,
            pilot,
            joints.joints_rad[0],
            PATIENCE * timed.duration_s,
            robot.control_hz,
            frame,
            motions,
            film,
            pilot.has_ended,
        )
    return Replay(loop.tracking, joints, timed, loop.unreachable, len(loop.time_s), pilot, film)


def replay_table(document: Mapping[str, Any]) -> str:
    """What the arm did, in lines for people."""
    if not document["executed"]:
        return f"not executed: {document['reason']}"
    lost = f", {len(document['unreachable'])} not" if document["unreachable"] else ""
    timing = f"{document['timing']}, stretched {document['stretch']:.2f} times"
    rows = [
        ("reached by inverse kinematics", f"{document['reached_share']:.1%} of the poses{lost}"),
        ("duration", f"{document['duration_s']:.2f} s ({'in closed loop' if document['closed_loop'] else timing})"),
        (
            "tracking error",
            f"at most {1000 * document['tracking_worst_m']:.2f} mm, "
            f"{np.degrees(document['tracking_worst_rad']):.2f} deg",
        ),
        ("joint-limit margin", f"{np.degrees(document['limit_margin_rad']):.1f} deg"),
    ]
    if document["clearance_m"]:
        link, apart = min(document["clearance_m"].items(), key=lambda item: item[1])
        rows.append(("smallest clearance", f"{1000 * apart:.1f} mm ({link})"))
        rows.append(("contacts", ", ".join(document["contacts"]) or "none"))
    if document["closed_loop"]:
        reached = "reached" if document["reached_goal"] else "not reached"
        rows.append(("goal", f"{reached}; {document['waited_s']:.2f} s without a way on"))
        rows.append(("replanned", f"{document['replans']} times, {document['replan_median_ms']:.1f} ms median"))
    for one in document["unreachable"][:5]:
        left = f"{1000 * one['position_error_m']:.1f} mm, {np.degrees(one['orientation_error_rad']):.1f} deg remain"
        rows.append((f"  pose {one['index']}", f"out of reach: {left}"))
    return aligned(rows)


def _planned(plan: Artefacts, legs: Sequence[Mapping[str, Any]]) -> Planned:
    with np.load(plan.path("path.npz"), allow_pickle=False) as stored:
        path, progress = PosePath(stored["position_m"], stored["orientation"]), stored["progress"]
    return Planned(path, progress, [0, *np.cumsum([leg["points"] - 1 for leg in legs]).tolist()])


def _frame(robot: RobotConfig) -> panda.Frame:
    frame: panda.Frame = robot.frame.value
    return frame


def _furnish(
    scene: PandaScene, config: ReplayStageConfig, bodies: Sequence[MovingBody], shown: PosePath | None
) -> None:
    """Put everything into the scene: what the hand holds, obstacles, and the dots of a path in pictures."""
    if config.planning.tool_radius_m > 0:
        radius_m = config.planning.tool_radius_m
        scene.attach(GraspedCylinder(radius_m, config.robot.tool_length_m or 2 * radius_m))
    for body in bodies:
        scene.add_obstacle(body.name, body.body, body.motion.offset(0.0))
    if shown is not None:
        draw_path(scene, shown.position_m)


def _replans(robot: RobotConfig, bodies: Sequence[MovingBody], duration_s: float) -> bool:
    """Whether to replan on the way; unless it is said, where an obstacle moves."""
    if robot.closed_loop is not None:
        return robot.closed_loop
    return any(body.motion.travelled(0.0, duration_s) > 0 for body in bodies)


def _rows(path: PosePath, rows: list[int]) -> PosePath:
    return PosePath(path.position_m[rows], path.orientation[rows])


def _timed(
    robot: RobotConfig,
    skilled: Skilled,
    demonstrations: Demonstrations,
    joints: JointPath,
    progress: Float[np.ndarray, " point"],
) -> TimedJoints:
    if robot.timing is TimingLaw.fastest:
        return fastest(joints.joints_rad, share_of_limits=robot.share_of_limits)
    trained = demonstrations.select(skilled.skill.train_demos)
    mean_s = float(np.mean([one.duration_s for one in trained.trajectories]))
    shares = share_of_path_at_time(skilled.manifold.data.progress, progress)
    return like_demonstration(joints.joints_rad, shares, robot.duration_s or mean_s)


def _document(config: ReplayStageConfig, done: Replay) -> dict[str, Any]:
    tracking, joints, pilot = done.tracking, done.joints, done.pilot
    return {
        "executed": True,
        "frame": config.robot.frame.value,
        "timing": config.robot.timing.value,
        "duration_s": float(tracking.time_s[-1]),
        "stretch": _stretch(done),
        "reached_share": 1 - len(done.unreachable) / done.asked,
        "unreachable": [vars(one) for one in done.unreachable],
        "ik_worst_m": float(joints.position_error_m.max()),
        "ik_worst_rad": float(joints.orientation_error_rad.max()),
        "largest_joint_step_rad": joints.largest_step_rad,
        "tracking_worst_m": float(tracking.position_error_m.max()),
        "tracking_worst_rad": float(tracking.orientation_error_rad.max()),
        "limit_margin_rad": float(tracking.limit_margin_rad.min()),
        "clearance_m": tracking.smallest_clearance_m if solids(config.obstacle) else {},
        "contacts": tracking.contact_steps,
        "closed_loop": pilot is not None,
        "replans": 0 if pilot is None else len(pilot.seconds),
        "replan_median_ms": None if pilot is None else 1000 * float(np.median(pilot.seconds)),
        "waited_s": 0.0 if pilot is None else pilot.waited_s,
        "reached_goal": None if pilot is None else pilot.reached_goal,
    }


def _stretch(done: Replay) -> float:
    """How many times longer than its own timing the motion took; a closed loop has no timing of its own."""
    return done.timed.stretch if done.pilot is None else 1.0


def _trajectory(demonstrations: Demonstrations, done: Replay, frame: str) -> Demonstrations:
    """What was executed, in the layout of demonstrations, to be run elsewhere."""
    tracking = done.tracking
    channels = {
        "position_m": tracking.position_m,
        "orientation_wxyz": tracking.orientation_wxyz,
        "joints_rad": tracking.commanded_joints_rad,
    }
    one = Trajectory(tracking.time_s - tracking.time_s[0], channels, "geodesic")
    return Demonstrations(
        f"{demonstrations.name}/replay",
        (one,),
        "R3xS3xjoint",
        f"base of the Panda, frame {frame}",
        f"planned by geomotion from {demonstrations.name} and executed in simulation; {demonstrations.source}",
        demonstrations.licence,
    )


def _picture(config: ReplayStageConfig, done: Replay) -> ReplayPicture:
    tracking = done.tracking
    commanded_m, _ = panda_chain(config.robot.frame.value).pose(tracking.commanded_joints_rad)
    return ReplayPicture(
        tracking.time_s,
        tracking.position_error_m,
        tracking.orientation_error_rad,
        tracking.limit_margin_rad,
        tracking.clearance_time_s,
        tracking.clearance_m,
        commanded_m,
        tracking.position_m,
        _stretch(done),
    )
