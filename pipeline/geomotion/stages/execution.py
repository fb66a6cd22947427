"""A planned motion on the simulated arm: inverse kinematics, timing, and the simulation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from geomotion import arms
from geomotion.config import ArmConfig, MetricConfig, ObstacleConfig, PlanningConfig, RobotConfig, TimingLaw
from geomotion.demos.demonstrations import Demonstrations
from geomotion.obstacles.motion import MovingBody
from geomotion.robot import panda
from geomotion.robot.arm import Arm
from geomotion.robot.closed_loop import closed_loop
from geomotion.robot.film import Camera, Film, draw_path
from geomotion.robot.grasp import GraspedCylinder
from geomotion.robot.gripper import Gripper
from geomotion.robot.inverse_kinematics import JointPath, UnreachablePose, exactly, solve_path
from geomotion.robot.panda_arm import panda_arm
from geomotion.robot.recording import Tracking
from geomotion.robot.scene import ArmScene
from geomotion.robot.timed import TimedJoints
from geomotion.robot.timing import fastest, like_demonstration
from geomotion.robot.tracking import follow
from geomotion.scores.configurations import ConfigurationPath
from geomotion.scores.paths import MotionPath
from geomotion.stages.demonstrated_timing import share_of_path_at_time
from geomotion.stages.graph import Skilled
from geomotion.stages.outline import outline
from geomotion.stages.replan import Pilot, make_pilot
from geomotion.stages.scene import moving_bodies

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
        path: Poses, or configurations of the arm.
        progress: Share of the demonstrated motion that is done at each of them.
        stops: Rows of start, places on the way, and goal.
    """

    path: MotionPath
    progress: Float[np.ndarray, " point"]
    stops: list[int]


@dataclass(frozen=True)
class Replay:
    """What the arm did.

    Attributes:
        arm: Which one.
        path: What was planned.
        tracking: Measured against commanded.
        joints: The planned path, poses by inverse kinematics.
        timed: The motion that was commanded; of a closed loop, the one planned before it began.
        unreachable: Poses asked for that the arm cannot take: of the path, or of the periods of a closed loop.
        asked: How many poses were asked for.
        pilot: What led a closed loop; None if the path was followed as planned.
        film: Pictures, if they were asked for.
    """

    arm: Arm
    path: MotionPath
    tracking: Tracking
    joints: JointPath
    timed: TimedJoints
    unreachable: Sequence[UnreachablePose]
    asked: int
    pilot: Pilot | None
    film: Film | None


def execute(config: ReplayStageConfig, skilled: Skilled, demonstrations: Demonstrations, planned: Planned) -> Replay:
    """Inverse kinematics, timing, and the motion in the simulator, replanned on the way where something moves."""
    robot, bodies = config.robot, moving_bodies(config.obstacle, 3)
    path = planned.path
    arm, gripper = _arm_and_gripper(skilled.skill.arm, robot)
    joints = _joints(path, arm)
    timed = _timed(robot, skilled, demonstrations, arm, joints, planned.progress)
    film = Film(fps=robot.film_fps, camera=_camera(arm, joints, bodies)) if robot.film else None
    motions = {body.name: body.motion.offset for body in bodies}
    with ArmScene(arm, gripper, table=robot.table) as scene:
        _furnish(scene, config, bodies, None if film is None else path)
        if not _replans(robot, bodies, timed.duration_s):
            tracking = follow(scene, timed, motions, film)
            return Replay(arm, path, tracking, joints, timed, joints.unreachable, len(path), None, film)
        pilot = make_pilot(
            robot, config.planning, skilled, demonstrations, path.with_vectors(path.vectors[planned.stops]), bodies
        )
        loop = closed_loop(
            scene,
            pilot,
            joints.joints_rad[0],
            PATIENCE * timed.duration_s,
            robot.control_hz,
            motions,
            film,
            pilot.has_ended,
        )
    return Replay(arm, path, loop.tracking, joints, timed, loop.unreachable, len(loop.time_s), pilot, film)


def _arm_and_gripper(arm: ArmConfig | None, robot: RobotConfig) -> tuple[Arm, Gripper | None]:
    """The arm whose configurations were learned; poses are those of a frame of the Panda."""
    if arm is None:
        return panda_arm(tip_link=panda.FRAME_LINKS[robot.frame.value]), panda.GRIPPER
    return arms.build(arm), arms.gripper(arm)


def _joints(path: MotionPath, arm: Arm) -> JointPath:
    if isinstance(path, ConfigurationPath):
        return exactly(path.joints_rad, arm.limits)
    return solve_path(path.position_m, path.orientation, panda.frame_of(arm.tip_link))


def _camera(arm: Arm, joints: JointPath, bodies: Sequence[MovingBody]) -> Camera:
    """The Panda is seen as always, so that films can be compared; other arms with their base, way and obstacles."""
    if arm.joint_names == panda.JOINTS:
        return Camera()
    passed_m = arm.chain.points(joints.joints_rad, arm.joint_points()).reshape(-1, 3)
    obstacles_m = [outline(body.body)[0] + body.motion.offset(0.0) for body in bodies]
    return Camera.around(passed_m, np.concatenate([np.zeros((1, 3)), *obstacles_m]))


def _furnish(
    scene: ArmScene, config: ReplayStageConfig, bodies: Sequence[MovingBody], shown: MotionPath | None
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


def _timed(
    robot: RobotConfig,
    skilled: Skilled,
    demonstrations: Demonstrations,
    arm: Arm,
    joints: JointPath,
    progress: Float[np.ndarray, " point"],
) -> TimedJoints:
    if robot.timing is TimingLaw.fastest:
        return fastest(joints.joints_rad, arm.limits, robot.share_of_limits)
    trained = demonstrations.select(skilled.skill.train_demos)
    mean_s = float(np.mean([one.duration_s for one in trained.trajectories]))
    shares = share_of_path_at_time(skilled.manifold.data.progress, progress)
    return like_demonstration(joints.joints_rad, shares, robot.duration_s or mean_s, arm.limits)
