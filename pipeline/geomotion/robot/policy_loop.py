"""The simulated arm under a policy that asks for velocities, in velocity control, while it is disturbed.

The arm yields to forces at its tip: to the velocity that the policy asks for comes that of a damper under the force
(admittance control). Motors keep velocities, not positions, so that nothing but the policy leads back to a path.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from geomotion.errors import InvalidSetting
from geomotion.robot.closed_loop import steps_per_period
from geomotion.robot.disturbances import Displacement, Measured, Push, Sensors, Vector
from geomotion.robot.film import Film, ForceArrow
from geomotion.robot.inverse_kinematics import solve_pose
from geomotion.robot.panda import frame_of
from geomotion.robot.recording import AT_REST, Motions, Recorder, Tracking
from geomotion.robot.resolved_rate import Joints, ResolvedRate, TipVelocity
from geomotion.robot.scene import ArmScene
from geomotion.robot.timed import RATE_HZ
from geomotion.types import Bool, Float

Policy = Callable[[Measured, float], TipVelocity | Joints]
"""Velocity of the tip, or of the joints [rad/s], for what is measured at a time since the start [s]."""

NO_FORCE_N = np.zeros(3)


@dataclass(frozen=True)
class PolicyRun:
    """What came of a policy.

    Attributes:
        tracking: Where the joints were, and where they had been by now at the velocities of their control period.
        velocity_rad_per_s: Measured of each joint, at the times of `tracking`.
        torque_nm: Of each motor, at the same times.
        speed_m_per_s: Of the tip, at the same times.
        is_cut_short: Whether limits of the joints kept them from what was asked for, in each control period.
        thinking_s: Computing time of the policy in each period.
    """

    tracking: Tracking
    velocity_rad_per_s: Float[np.ndarray, "time joint"]
    torque_nm: Float[np.ndarray, "time joint"]
    speed_m_per_s: Float[np.ndarray, " time"]
    is_cut_short: Bool[np.ndarray, " period"]
    thinking_s: Float[np.ndarray, " period"]


@dataclass
class PolicyLoop:
    """Algorithm 2 of the thesis on an arm: measure, ask the policy, move, again and again.

    Attributes:
        scene: With the arm and all obstacles.
        policy: Where to.
        rate_hz: How often the policy is asked; divides 240.
        damping_n_s_per_m: Force at the tip over the velocity at which the arm yields to it.
        sensors: What the policy is told.
        disturbances: Forces and displacements; they may overlap.
        motions: Obstacle -> function of the time [s] that gives its offset from its place [m]; the others rest.
        film: Takes pictures, if given.
    """

    scene: ArmScene
    policy: Policy
    rate_hz: float = 60.0
    damping_n_s_per_m: float = 100.0
    sensors: Sensors = field(default_factory=Sensors)
    disturbances: Sequence[Push | Displacement] = ()
    motions: Motions = field(default_factory=lambda: AT_REST)
    film: Film | None = None
    _velocities: list[Joints] = field(default_factory=list)
    _torques: list[Joints] = field(default_factory=list)
    _speeds: list[float] = field(default_factory=list)
    _arrow: ForceArrow | None = None

    def __post_init__(self) -> None:
        if self.film is not None:
            self._arrow = ForceArrow(self.scene)

    def run(self, start_rad: Joints, duration_s: float) -> PolicyRun:
        """Put the arm at a start [rad] and let it move for a while [s].

        Raises:
            InvalidSetting: If the rate does not divide 240 Hz, or the duration is shorter than a period.
            UnknownName: If a moving obstacle is not in the scene.
        """
        steps, period_s = steps_per_period(self.rate_hz, "replay.control_hz"), 1 / self.rate_hz
        if not duration_s >= period_s:
            raise InvalidSetting("replay.duration_s", duration_s, f"{period_s:.3g} s, one period, or more")
        arm, recorder = self.scene.arm, Recorder(self.scene, self.motions, self.film)
        resolve = ResolvedRate(arm.chain, arm.limits, start_rad)
        self.scene.set_joints(start_rad)
        self._velocities, self._torques, self._speeds = [], [], []
        velocity, is_cut_short, thinking_s = np.zeros_like(start_rad), [], []
        for period in range(round(duration_s * self.rate_hz)):
            time_s = period * period_s
            recorder.prepare(time_s)
            self._displace(time_s, time_s + period_s)
            joints, _ = self.scene.joints()
            seen = self.sensors.read(Measured(*self.scene.end_effector_pose(), joints))
            begun = time.perf_counter()
            wanted = self.policy(seen, time_s)
            thinking_s.append(time.perf_counter() - begun)
            yielding = self._force(time_s) / self.damping_n_s_per_m
            before, velocity = velocity, resolve(joints, wanted, yielding, velocity, period_s)
            is_cut_short.append(resolve.is_short(joints, wanted, yielding, velocity))
            for step in range(1, steps + 1):
                driven = before + step / steps * (velocity - before)
                joints = joints + driven / RATE_HZ
                self._step(recorder, time_s + step / RATE_HZ, driven, joints)
        return PolicyRun(
            recorder.tracking(),
            np.array(self._velocities),
            np.array(self._torques),
            np.array(self._speeds),
            np.array(is_cut_short),
            np.array(thinking_s),
        )

    def _step(self, recorder: Recorder, time_s: float, driven_rad_per_s: Joints, joints_rad: Joints) -> None:
        """One step of the simulation that ends at a time [s], with the joints where they should be then [rad]."""
        scene = self.scene
        before_m, _ = scene.end_effector_pose()
        force = self._force(time_s - 1 / RATE_HZ)
        recorder.prepare(time_s)
        scene.simulated.drive(driven_rad_per_s)
        scene.simulated.push(force)
        scene.step()
        self._velocities.append(scene.joints()[1])
        self._torques.append(scene.simulated.torques())
        tip_m, _ = scene.end_effector_pose()
        self._speeds.append(float(np.linalg.norm(tip_m - before_m)) * RATE_HZ)
        if self._arrow is not None:
            self._arrow.show(time_s, tip_m, force)
        recorder.note(time_s, joints_rad)

    def _force(self, time_s: float) -> Vector:
        pushes = (one for one in self.disturbances if isinstance(one, Push))
        return sum((push.force_at(time_s) for push in pushes), start=NO_FORCE_N)

    def _displace(self, from_s: float, to_s: float) -> None:
        for one in self.disturbances:
            if isinstance(one, Displacement) and from_s <= one.time_s < to_s:
                position_m, orientation = self.scene.end_effector_pose()
                frame = frame_of(self.scene.arm.tip_link)
                found = solve_pose(position_m + one.offset_m, orientation, self.scene.joints()[0], frame)
                self.scene.set_joints(found.joints_rad[0])
