"""The simulated arm under a controller that is asked anew in every period, among moving obstacles."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from geomotion.errors import InvalidSetting
from geomotion.robot import panda
from geomotion.robot.film import Film
from geomotion.robot.inverse_kinematics import UnreachablePose, solve_pose
from geomotion.robot.recording import AT_REST, Motions, Recorder, Tracking
from geomotion.robot.scene import ArmScene
from geomotion.robot.timed import RATE_HZ
from geomotion.types import Float

Position = Float[np.ndarray, "3"]
Quaternion = Float[np.ndarray, "4"]
Joints = Float[np.ndarray, " joint"]
Target = tuple[Position, Quaternion] | Joints
Controller = Callable[[float, Position, Quaternion], Target]


@dataclass(frozen=True)
class ClosedLoop:
    """What came of a controller.

    Attributes:
        tracking: Commanded joints against measured ones.
        time_s: Start of each control period [s].
        target_position_m: What the controller asked for in each period [m].
        target_orientation_wxyz: Likewise.
        unreachable: Periods whose pose the arm cannot take, and how near it comes.
    """

    tracking: Tracking
    time_s: Float[np.ndarray, " period"]
    target_position_m: Float[np.ndarray, "period 3"]
    target_orientation_wxyz: Float[np.ndarray, "period 4"]
    unreachable: tuple[UnreachablePose, ...]


def closed_loop(
    scene: ArmScene,
    controller: Controller,
    start_rad: Joints,
    duration_s: float,
    control_hz: float = 60.0,
    motions: Motions = AT_REST,
    film: Film | None = None,
    has_ended: Callable[[], bool] = lambda: False,
) -> ClosedLoop:
    """Let a controller lead the tip of the arm, or its joints, within the joints' limits of velocity and acceleration.

    Where the pose asked for is beyond the joints' range or too far for one period, the arm goes towards it.

    Args:
        scene: Its arm is put at the start.
        controller: Time [s] and measured pose (m, wxyz) -> the pose, or the joint positions, of one period later.
        start_rad: [rad].
        duration_s: How long [s], at most.
        control_hz: How often the controller is asked [Hz]; divides 240.
        motions: Obstacle -> function of the time [s] that gives its offset from its place [m]; the others rest.
        film: Takes pictures, if given.
        has_ended: Asked after each period: whether it was the last one.

    Raises:
        InvalidSetting: If `control_hz` does not divide 240, the duration is shorter than a period, or the controller
            returns what is no pose, or a pose for an arm that is no Panda.
        UnknownName: If a moving obstacle is not in the scene.
    """
    steps = steps_per_period(control_hz, "robot.control_hz")
    if not duration_s * control_hz >= 1:
        raise InvalidSetting("robot.duration_s", duration_s, f"{1 / control_hz:.3g} s, one period, or more")
    recorder, asked, unreachable = Recorder(scene, motions, film), [], []
    scene.set_joints(start_rad)
    joints, velocity, last_target = start_rad, np.zeros_like(start_rad), start_rad
    for period in range(round(duration_s * control_hz)):
        time_s = period / control_hz
        recorder.prepare(time_s)
        wanted = controller(time_s, *scene.end_effector_pose())
        if isinstance(wanted, tuple):
            solution = solve_pose(*wanted, last_target, panda.frame_of(scene.arm.tip_link))
            unreachable += [replace(pose, index=period) for pose in solution.unreachable]
            target = solution.joints_rad[0]
        else:
            target, wanted = wanted, scene.arm.chain.pose(wanted)
        asked.append((time_s, *wanted))
        velocity = approach_velocity(joints, velocity, last_target, target, 1 / control_hz, scene.arm.limits)
        last_target = target
        for step in range(1, steps + 1):
            recorder.prepare(time_s + step / RATE_HZ)
            scene.command(joints, velocity)
            joints = joints + velocity / RATE_HZ
            scene.step()
            recorder.note(time_s + step / RATE_HZ, joints)
        if has_ended():
            break
    times, positions, orientations = (np.array(column) for column in zip(*asked, strict=True))
    return ClosedLoop(recorder.tracking(), times, positions, orientations, tuple(unreachable))


def approach_velocity(
    joints_rad: Joints,
    velocity_rad_per_s: Joints,
    last_target_rad: Joints,
    target_rad: Joints,
    period_s: float,
    limits: panda.JointLimits,
) -> Joints:
    """The velocity for one period that leads to where a target will be at its end [rad/s], each joint for itself.

    It differs from the last by no more than acceleration allows. A target at rest is not overshot, because room to
    brake is left; one in motion is expected to go on.
    """
    target_velocity = np.clip(
        (target_rad - last_target_rad) / period_s, -limits.velocity_rad_per_s, limits.velocity_rad_per_s
    )
    way = target_rad - period_s * target_velocity - joints_rad
    change = limits.acceleration_rad_per_s2 * period_s  # the largest in one period
    braking = limits.stopping_speed(np.abs(way), period_s)
    catching_up = np.sign(way) * np.minimum(np.maximum(braking, change), np.abs(way) / period_s)
    wanted = np.clip(target_velocity + catching_up, -limits.velocity_rad_per_s, limits.velocity_rad_per_s)
    velocity: Joints = np.clip(wanted, velocity_rad_per_s - change, velocity_rad_per_s + change)
    return velocity


def steps_per_period(control_hz: float, key: str) -> int:
    """How many steps of the simulation a control period has.

    Raises:
        InvalidSetting: If that is not a whole number, naming the setting.
    """
    steps = RATE_HZ / control_hz if control_hz > 0 else 0.0
    if steps < 1 or steps != round(steps):
        raise InvalidSetting(key, control_hz, f"a rate that divides {RATE_HZ:g} Hz")
    return round(steps)
