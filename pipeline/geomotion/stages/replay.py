"""Execute a planned motion on the simulated Panda."""

from collections.abc import Callable, Mapping
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
from geomotion.robot.film import Film, draw_path
from geomotion.robot.grasp import GraspedCylinder
from geomotion.robot.inverse_kinematics import JointPath, solve_path
from geomotion.robot.recording import Tracking
from geomotion.robot.scene import PandaScene
from geomotion.robot.timed import TimedJoints
from geomotion.robot.timing import fastest, like_demonstration
from geomotion.robot.tracking import follow
from geomotion.scores.paths import PosePath
from geomotion.stages.demonstrated_timing import share_of_path_at_time
from geomotion.stages.graph import load_skilled
from geomotion.stages.replan import Replanned, replay_closed_loop
from geomotion.stages.scene import moving_bodies, solids
from geomotion.tables import aligned
from geomotion.tracking import Artefacts, StageRun


@dataclass(frozen=True)
class ReplayStageConfig:
    """What the replay stage needs."""

    robot: RobotConfig
    planning: PlanningConfig
    metric: MetricConfig
    obstacle: ObstacleConfig


@dataclass(frozen=True)
class Replay:
    """What the arm did.

    Attributes:
        tracking: Measured against commanded.
        joints: Inverse kinematics of the planned path.
        timed: The motion that was commanded; of a closed loop, the one planned before it began.
        replanned: What replanning did; None if the path was followed as planned.
        film: Pictures, if they were asked for.
    """

    tracking: Tracking
    joints: JointPath
    timed: TimedJoints
    replanned: Replanned | None
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
    with np.load(inputs["plan"].path("path.npz"), allow_pickle=False) as stored:
        path, progress = PosePath(stored["position_m"], stored["orientation"]), stored["progress"]
    demonstrations = storage.load(inputs["ingest"].folder)
    bodies = moving_bodies(config.obstacle, 3)
    done = execute(config, skilled, demonstrations, path, progress, bodies)
    write_json(run.folder / "replay.json", _document(config, done))
    trajectory = _trajectory(demonstrations, done, config.robot.frame.value)
    storage.save(trajectory, run.folder / "trajectory")
    if done.film is not None:
        done.film.save(run.folder / "film.gif")
    save_replay_figure(_picture(config, done), run.folder / "figures")


def execute(
    config: ReplayStageConfig,
    skilled: Any,
    demonstrations: Demonstrations,
    path: PosePath,
    progress: Float[np.ndarray, " point"],
    bodies: list[MovingBody],
) -> Replay:
    """Inverse kinematics, timing, and the motion in the simulator, replanned on the way where something moves."""
    robot = config.robot
    frame: panda.Frame = robot.frame.value
    joints = solve_path(path.position_m, path.orientation, frame)
    timed = _timed(robot, skilled, demonstrations, joints, progress)
    moves = any(
        np.any(body.motion.velocity(0.0)) or body.motion.travelled(0.0, timed.duration_s) > 0 for body in bodies
    )
    film = Film(fps=robot.film_fps) if robot.film else None
    with PandaScene(table=robot.table) as scene:
        if config.planning.tool_radius_m > 0:
            scene.attach(GraspedCylinder(config.planning.tool_radius_m, robot.tool_length_m))
        for body in bodies:
            scene.add_obstacle(body.name, body.body, body.motion.offset(0.0))
        if film is not None:
            draw_path(scene, path.position_m)
        if moves if robot.closed_loop is None else robot.closed_loop:
            replanned = replay_closed_loop(
                scene, config, skilled, demonstrations, path, progress, bodies, joints, timed, film
            )
            return Replay(replanned.loop.tracking, joints, timed, replanned, film)
        tracking = follow(scene, timed, frame, _motions(bodies), film)
    return Replay(tracking, joints, timed, None, film)


def replay_table(document: Mapping[str, Any]) -> str:
    """What the arm did, in lines for people."""
    if not document["executed"]:
        return f"not executed: {document['reason']}"
    lost = f", {len(document['unreachable'])} not" if document["unreachable"] else ""
    rows = [
        ("reached by inverse kinematics", f"{document['reached_share']:.1%} of the poses{lost}"),
        (
            "duration",
            f"{document['duration_s']:.2f} s ({document['timing']}, stretched {document['stretch']:.2f} times)",
        ),
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
        rows.append(("replanned", f"{document['replans']} times, {document['replan_median_ms']:.1f} ms median"))
    for one in document["unreachable"][:5]:
        left = f"{1000 * one['position_error_m']:.1f} mm, {np.degrees(one['orientation_error_rad']):.1f} deg remain"
        rows.append((f"  pose {one['index']}", f"out of reach: {left}"))
    return aligned(rows)


def _timed(
    robot: RobotConfig,
    skilled: Any,
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


def _motions(bodies: list[MovingBody]) -> dict[str, Callable[[float], Float[np.ndarray, "3"]]]:
    return {body.name: body.motion.offset for body in bodies}


def _document(config: ReplayStageConfig, done: Replay) -> dict[str, Any]:
    tracking, joints = done.tracking, done.joints
    return {
        "executed": True,
        "frame": config.robot.frame.value,
        "timing": config.robot.timing.value,
        "duration_s": float(tracking.time_s[-1]),
        "stretch": done.timed.stretch,
        "reached_share": float(joints.reached.mean()),
        "unreachable": [vars(one) for one in joints.unreachable],
        "ik_worst_m": float(joints.position_error_m.max()),
        "ik_worst_rad": float(joints.orientation_error_rad.max()),
        "largest_joint_step_rad": joints.largest_step_rad,
        "tracking_worst_m": float(tracking.position_error_m.max()),
        "tracking_worst_rad": float(tracking.orientation_error_rad.max()),
        "limit_margin_rad": float(tracking.limit_margin_rad.min()),
        "clearance_m": tracking.smallest_clearance_m if solids(config.obstacle) else {},
        "contacts": tracking.contact_steps,
        "closed_loop": done.replanned is not None,
        "replans": 0 if done.replanned is None else len(done.replanned.seconds),
        "replan_median_ms": None if done.replanned is None else 1000 * float(np.median(done.replanned.seconds)),
        "waited_s": 0.0 if done.replanned is None else done.replanned.waited_s,
        "reached_goal": None if done.replanned is None else done.replanned.reached_goal,
    }


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
        done.timed.stretch,
    )
