"""Joint velocities for a velocity of the arm's tip: damped least squares within the joints' limits."""

from dataclasses import dataclass

import numpy as np

from geomotion.robot.chain import Chain
from geomotion.robot.panda import JointLimits
from geomotion.robot.pose_search import KEEP_FROM_LIMIT_RAD, LEVER_M
from geomotion.types import Float

SMALL_M = 0.05  # singular values below this [m/rad] are damped
DAMPING_M = 0.05  # the most, at a singularity
POSTURE_PER_S = 0.5  # rate at which the redundant motion leads to the posture
AVOIDANCE_PER_S = 4.0  # the same, away from a limit nearby
SHORT, SHORT_M_PER_S = 0.05, 0.002  # of what was asked for, and at least: less is no loss

Joints = Float[np.ndarray, " joint"]
Vector = Float[np.ndarray, "3"]


@dataclass(frozen=True)
class TipVelocity:
    """How the tip of an arm moves, in the base frame.

    Attributes:
        velocity_m_per_s: Of its position.
        omega_rad_per_s: Of its orientation.
    """

    velocity_m_per_s: Vector
    omega_rad_per_s: Vector

    @property
    def task(self) -> Float[np.ndarray, "6"]:
        """Both in one, the second times the lever [m/s]."""
        return np.concatenate([self.velocity_m_per_s, LEVER_M * self.omega_rad_per_s])


@dataclass(frozen=True)
class ResolvedRate:
    """Velocities of joints that move the tip, or the joints, as it is wanted, as far as limits allow.

    Attributes:
        chain: Of the arm.
        limits: Of its joints.
        posture_rad: Where the motion that the tip leaves free leads.
    """

    chain: Chain
    limits: JointLimits
    posture_rad: Joints

    def __call__(
        self,
        joints_rad: Joints,
        wanted: TipVelocity | Joints,
        yielding_m_per_s: Vector,
        before_rad_per_s: Joints,
        period_s: float,
    ) -> Joints:
        """Velocities for one period [rad/s].

        Args:
            joints_rad: Where the joints are.
            wanted: Velocity of the tip, or of the joints.
            yielding_m_per_s: What comes to the velocity of the tip.
            before_rad_per_s: Velocities of the last period.
            period_s: How long these hold.
        """
        J = self._jacobian(joints_rad)
        yielding = np.concatenate([yielding_m_per_s, np.zeros(3)])
        slowest, fastest = allowed(joints_rad, before_rad_per_s, period_s, self.limits)
        if isinstance(wanted, TipVelocity):
            return self._redistributed(J, wanted.task + yielding, self._aside(joints_rad), slowest, fastest)
        return np.asarray(np.clip(wanted + damped_inverse(J) @ yielding, slowest, fastest))

    def is_short(
        self, joints_rad: Joints, wanted: TipVelocity | Joints, yielding_m_per_s: Vector, found_rad_per_s: Joints
    ) -> bool:
        """Whether the tip moves otherwise than it should with velocities found for the joints."""
        J = self._jacobian(joints_rad)
        task = wanted.task if isinstance(wanted, TipVelocity) else J @ wanted
        task = task + np.concatenate([yielding_m_per_s, np.zeros(3)])
        missing, asked = (float(np.linalg.norm(one)) for one in (J @ found_rad_per_s - task, task))
        return missing > max(SHORT * asked, SHORT_M_PER_S)

    def _jacobian(self, joints_rad: Joints) -> Float[np.ndarray, "6 joint"]:
        _, J = self.chain.pose_and_jacobian(joints_rad)
        J[3:] *= LEVER_M
        return J

    @staticmethod
    def _redistributed(
        J: Float[np.ndarray, "6 joint"], task: Float[np.ndarray, "6"], aside: Joints, slowest: Joints, fastest: Joints
    ) -> Joints:
        """A joint that would exceed what it may do does what it may, and the others make up for it.

        Source: Flacco, De Luca, Khatib (2012), Motion control of redundant robots under joint constraints.
        """
        found, is_free = np.zeros_like(aside), np.ones(len(aside), dtype=bool)
        for _ in range(len(aside)):
            K = J * is_free
            inverse = damped_inverse(K)
            free = inverse @ (task - J @ np.where(is_free, 0.0, found)) + aside - inverse @ (K @ aside)
            found = np.where(is_free, free, found)
            is_beyond = is_free & ((found < slowest) | (found > fastest))
            found = np.clip(found, slowest, fastest)
            if not is_beyond.any():
                break
            is_free &= ~is_beyond
        return found

    def _aside(self, joints_rad: Joints) -> Joints:
        """Where redundant motion leads: to the posture, and away from limits nearby [rad/s]."""
        lower, upper = self.limits.lower_rad, self.limits.upper_rad
        inwards = np.maximum(lower + KEEP_FROM_LIMIT_RAD - joints_rad, 0)
        inwards = inwards - np.maximum(joints_rad - upper + KEEP_FROM_LIMIT_RAD, 0)
        aside: Joints = POSTURE_PER_S * (self.posture_rad - joints_rad) + AVOIDANCE_PER_S * inwards
        return aside


def damped_inverse(J: Float[np.ndarray, "task joint"]) -> Float[np.ndarray, "joint task"]:
    """Pseudo-inverse whose small singular values are damped, the more the smaller they are.

    Source: Nakamura, Hanafusa (1986), Inverse kinematic solutions with singularity robustness.
    """
    left, values, right = np.linalg.svd(J, full_matrices=False)
    damping = DAMPING_M**2 * np.maximum(1 - (values / SMALL_M) ** 2, 0)
    inverse: Float[np.ndarray, "joint task"] = (right.T * (values / (values**2 + damping))) @ left.T
    return inverse


def allowed(
    joints_rad: Joints, before_rad_per_s: Joints, period_s: float, limits: JointLimits
) -> tuple[Joints, Joints]:
    """Slowest and fastest velocities [rad/s] of one period: within limits of speed and change, able to stop in time."""
    change = limits.acceleration_rad_per_s2 * period_s
    low, high = before_rad_per_s - change, before_rad_per_s + change
    up, down = (
        np.minimum(limits.stopping_speed(room_rad, period_s), limits.velocity_rad_per_s)
        for room_rad in (limits.upper_rad - joints_rad, joints_rad - limits.lower_rad)
    )
    return np.clip(-down, low, high), np.clip(up, low, high)
