"""An episode: look, grasp, look, drop, in closed loop. Contacts and the place of the object decide what came of it."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol, runtime_checkable

import numpy as np

from geomotion.robot.closed_loop import steps_per_period
from geomotion.robot.disturbances import Measured
from geomotion.robot.film import Film, Frame
from geomotion.robot.rehearsed import wait
from geomotion.robot.resolved_rate import Joints, ResolvedRate, TipVelocity
from geomotion.robot.tabletop import CLOSED_M, CLOSING_S, FALLING_S, OPEN_M, Tabletop
from geomotion.robot.timed import RATE_HZ
from geomotion.types import Float

NEAR_M, SLOW_M_PER_S = 0.006, 0.02  # of the goal that the policy sees, and slower than this: the motion is over
LONGEST_S = 8.0  # of one motion
LIFTED_M = 0.05  # the object counts as lifted where both fingers hold it at least as high above where it lay

Vector = Float[np.ndarray, "3"]


class Outcome(Enum):
    """How an episode ends."""

    dropped_in_bin = "dropped into the bin"
    not_grasped = "not grasped"
    lost = "lost on the way"
    beside_bin = "dropped beside the bin"


@runtime_checkable
class LookingPolicy(Protocol):
    """A policy whose condition is a picture."""

    def begin(self) -> None:
        """Forget what was seen before."""
        ...

    def look(self, picture: Frame) -> Float[np.ndarray, " K"]:
        """Take the condition from a picture."""
        ...

    @property
    def goal_m(self) -> Vector:
        """Where the motion leads under it."""
        ...

    def __call__(self, measured: Measured, time_s: float) -> TipVelocity:
        """Velocity of the tip."""
        ...


@dataclass(frozen=True)
class Move:
    """Somebody moves the object.

    Attributes:
        time_s: After the start of the episode.
        place_m: Where to.
    """

    time_s: float
    place_m: Float[np.ndarray, "2"]


@dataclass(frozen=True)
class Episode:
    """What came of it.

    Attributes:
        outcome: By contacts and places.
        aimed_m: Where the hand meant to grasp after its last look before it did.
        object_m: Where the object lay then.
        duration_s: Of the whole.
        looks: Pictures that were taken.
        conditions: What the first look of each skill gave.
    """

    outcome: Outcome
    aimed_m: Vector
    object_m: Vector
    duration_s: float
    looks: int
    conditions: tuple[tuple[float, ...], ...]

    @property
    def succeeded(self) -> bool:
        """Whether the object was lifted by both fingers and lies in the bin."""
        return self.outcome is Outcome.dropped_in_bin


@dataclass
class Episodes:
    """The same scene and policies, one episode after the other.

    Attributes:
        tabletop: Scene.
        grasp: First policy.
        drop: Second policy.
        rest_rad: Where the arm waits.
        control_hz: How often policies are asked; divides 240.
        looks_per_s: How often the grasp looks again.
        look_until_m: From where the hand will grasp: nearer than this it looks no more.
        film: Takes pictures, if given.
    """

    tabletop: Tabletop
    grasp: LookingPolicy
    drop: LookingPolicy
    rest_rad: Joints
    control_hz: float = 30.0
    looks_per_s: float = 4.0
    look_until_m: float = 0.15
    film: Film | None = None
    _time_s: float = 0.0
    _looks: int = 0

    def run(self, moves: tuple[Move, ...] = ()) -> Episode:
        """One episode, from the arm at rest and the object where it lies now.

        Args:
            moves: Of the object, before it is grasped.

        Raises:
            InvalidSetting: If the control rate does not divide 240 Hz.
        """
        tabletop = self.tabletop
        self._time_s, self._looks = 0.0, 0
        tabletop.put_arm(self.rest_rad)
        waiting = list(moves)

        def watch(time_s: float, tip_m: Vector) -> None:
            while waiting and waiting[0].time_s <= time_s:
                tabletop.put_object(waiting.pop(0).place_m)
            is_due = int(time_s * self.looks_per_s) > int((time_s - 1 / self.control_hz) * self.looks_per_s)
            if is_due and np.linalg.norm(tip_m - self.grasp.goal_m) > self.look_until_m:
                self._look(self.grasp)

        self.grasp.begin()
        self.drop.begin()
        first = self._look(self.grasp)
        self._follow(self.grasp, watch)
        aimed, lying = self.grasp.goal_m, tabletop.object_m()
        self._pause(CLOSED_M, CLOSING_S)
        second = self._look(self.drop)
        highest = [0.0]

        def note(time_s: float, tip_m: Vector) -> None:
            if tabletop.is_held():
                highest.append(float(tabletop.object_m()[2] - lying[2]))

        self._follow(self.drop, note)
        was_lifted, was_held = max(highest) >= LIFTED_M, tabletop.is_held()
        self._pause(OPEN_M, FALLING_S)
        conditions = tuple(tuple(one.tolist()) for one in (first, second))
        return Episode(
            self._judged(was_lifted, was_held),
            aimed,
            lying,
            self._time_s,
            self._looks,
            conditions,
        )

    def _judged(self, was_lifted: bool, was_held: bool) -> Outcome:
        if not was_lifted:
            return Outcome.not_grasped
        if self.tabletop.is_in_bin() and self.tabletop.is_free():
            return Outcome.dropped_in_bin
        return Outcome.beside_bin if was_held else Outcome.lost

    def _look(self, policy: LookingPolicy) -> Float[np.ndarray, " K"]:
        self._looks += 1
        return policy.look(self.tabletop.picture())

    def _follow(self, policy: LookingPolicy, watch: Callable[[float, Vector], None]) -> None:
        """Ask the policy anew in every period until the arm rests at its goal, or too much time has passed."""
        scene = self.tabletop.scene
        steps, period_s = steps_per_period(self.control_hz, "episodes.control_hz"), 1 / self.control_hz
        resolve = ResolvedRate(scene.arm.chain, scene.arm.limits, self.rest_rad)
        velocity, nothing = np.zeros_like(self.rest_rad), np.zeros(3)
        for period in range(round(LONGEST_S * self.control_hz)):
            joints, _ = scene.joints()
            tip_m, orientation = scene.end_effector_pose()
            watch(period * period_s, tip_m)
            wanted = policy(Measured(tip_m, orientation, joints), period * period_s)
            if (
                np.linalg.norm(tip_m - policy.goal_m) < NEAR_M
                and np.linalg.norm(wanted.velocity_m_per_s) < SLOW_M_PER_S
            ):
                return
            before, velocity = velocity, resolve(joints, wanted, nothing, velocity, period_s)
            for step in range(1, steps + 1):
                scene.simulated.drive(before + step / steps * (velocity - before))
                scene.step()
            self._time_s += period_s
            if self.film is not None:
                self.film.watch(scene, self._time_s)

    def _pause(self, opening_m: float, duration_s: float) -> None:
        """Hold the arm while the fingers move and things fall."""
        joints, _ = self.tabletop.scene.joints()
        self.tabletop.move_fingers(opening_m)
        begun = self._time_s
        while self._time_s < begun + duration_s - 0.5 / RATE_HZ:
            wait(self.tabletop, 1 / self.control_hz, joints)
            self._time_s += 1 / self.control_hz
            if self.film is not None:
                self.film.watch(self.tabletop.scene, self._time_s)
