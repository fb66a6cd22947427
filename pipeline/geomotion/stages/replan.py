"""Replanning in closed loop: the simulated arm follows a controller that sees the obstacles move."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from geomotion.config import ToolShape
from geomotion.demos.demonstrations import Demonstrations
from geomotion.obstacles.motion import MovingBody
from geomotion.planning.controller import LEVER_M, ControllerSettings, GeodesicController, Pace
from geomotion.robot import panda
from geomotion.robot.closed_loop import ClosedLoop, closed_loop
from geomotion.robot.film import Film
from geomotion.robot.inverse_kinematics import JointPath
from geomotion.robot.scene import PandaScene
from geomotion.robot.timed import TimedJoints
from geomotion.scores.paths import PosePath
from geomotion.stages import planners
from geomotion.stages.graph import Skilled

if TYPE_CHECKING:
    from geomotion.stages.replay import ReplayStageConfig

PATIENCE = 4.0  # times the planned duration, after which a goal that is not reached is given up
SLOWEST = 0.25  # of the mean pace: demonstrations begin and end at rest, where a motion would never leave


@dataclass(frozen=True)
class Replanned:
    """What replanning did.

    Attributes:
        loop: What the arm did.
        bodies: Obstacles.
        seconds: Computing time of each step that planned [s].
        waited_s: How long there was no way on [s].
        reached_goal: Whether the motion arrived.
    """

    loop: ClosedLoop
    bodies: Sequence[MovingBody]
    seconds: list[float]
    waited_s: float
    reached_goal: bool


def replay_closed_loop(
    scene: PandaScene,
    config: "ReplayStageConfig",
    skilled: Skilled,
    demonstrations: Demonstrations,
    path: PosePath,
    progress: Float[np.ndarray, " point"],
    bodies: Sequence[MovingBody],
    joints: JointPath,
    timed: TimedJoints,
    film: Film | None,
) -> Replanned:
    """Follow the manifold from the first to the last pose of a path, looking at the obstacles all the time."""
    robot = config.robot
    planning = config.planning
    if planning.tool is ToolShape.auto:
        planning = replace(planning, tool=ToolShape.hand)
    planner = planners.planner(skilled, planning, robot.frame, robot.horizon_s)
    query = planner.query(path[:1], path[-1:])
    settings = ControllerSettings(1 / robot.control_hz)
    controller = GeodesicController(planner, query, demonstrated_pace(skilled, demonstrations), settings)
    seconds: list[float] = []

    def control(
        time_s: float, position_m: Float[np.ndarray, "3"], orientation_wxyz: Float[np.ndarray, "4"]
    ) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "4"]]:
        before, begun = controller.plans, time.perf_counter()
        pose = controller.step(time_s, bodies)
        if controller.plans > before:
            seconds.append(time.perf_counter() - begun)
        return pose.position_m[0], pose.orientation[0]

    frame: panda.Frame = robot.frame.value
    motions = {body.name: body.motion.offset for body in bodies}
    duration_s = PATIENCE * timed.duration_s
    loop = closed_loop(scene, control, joints.joints_rad[0], duration_s, robot.control_hz, frame, motions, film)
    return Replanned(loop, bodies, seconds, controller.waited_s, controller.arrived)


def demonstrated_pace(skilled: Skilled, demonstrations: Demonstrations) -> Pace:
    """How fast the demonstrations are on average at a progress."""
    data = skilled.manifold.data
    trained = demonstrations.select(skilled.skill.train_demos)
    shares = np.linspace(0, 1, 50)
    speeds = []
    for path, done, one in zip(data.originals, data.progress, trained.trajectories, strict=True):
        turns = 2 * np.linalg.norm(np.gradient(path.orientation, axis=0), axis=1)
        steps = np.hypot(np.linalg.norm(np.gradient(path.position_m, axis=0), axis=1), LEVER_M * turns)
        speeds.append(np.interp(shares, done, steps * (len(path) - 1) / one.duration_s))
    mean = np.mean(speeds, axis=0)
    mean = np.maximum(mean, SLOWEST * mean.mean())
    return lambda progress: float(np.interp(progress, shares, mean))
