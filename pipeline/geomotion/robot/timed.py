r"""A path with a time law: its derivatives, what they use of the limits, and its samples for a controller.

A path gives joint positions q(s) over its share s from 0 to 1, a time law s(t). Both are splines of class C² or more,

.. math:: \dot q = q' \dot s, \quad \ddot q = q'' \dot s^2 + q' \ddot s, \quad
          \dddot q = q''' \dot s^3 + 3 q'' \dot s \ddot s + q' \dddot s,

so the path is never left, and stretching time by a factor divides velocity, acceleration and jerk by its first, second
and third power: the least factor that keeps the limits is known exactly.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, CubicSpline

from geomotion.robot.panda import JointLimits
from geomotion.types import Float

RATE_HZ = 240.0
DEGREE = 5  # of the time law: four continuous derivatives, so that jerk is continuous where the path's is
SAMPLES_PER_KNOT = 8

Joints = Float[np.ndarray, "time joint"]
Shares = Float[np.ndarray, " time"]


@dataclass(frozen=True)
class LimitUse:
    """Largest share of each limit that a motion uses; 1 is the limit itself."""

    velocity: float
    acceleration: float
    jerk: float

    @property
    def stretch(self) -> float:
        """The factor on time that brings the largest of the three to its limit."""
        return max(self.velocity, math.sqrt(self.acceleration), math.cbrt(self.jerk))

    def stretched(self, factor: float) -> "LimitUse":
        """The shares once time is stretched by a factor."""
        return LimitUse(self.velocity / factor, self.acceleration / factor**2, self.jerk / factor**3)


@dataclass(frozen=True)
class TimedJoints:
    """A motion at 240 Hz, at rest at both ends.

    Attributes:
        time_s: From 0 [s].
        joints_rad: [rad].
        velocity_rad_per_s: [rad/s].
        acceleration_rad_per_s2: [rad/s²].
        share_of_path: How much of the path is behind, from 0 to 1, in rows.
        stretch: Factor between the duration wanted and the one given; 1 if no limit was in the way.
        use: Largest share of each limit.
    """

    time_s: Shares
    joints_rad: Joints
    velocity_rad_per_s: Joints
    acceleration_rad_per_s2: Joints
    share_of_path: Shares
    stretch: float
    use: LimitUse

    @property
    def duration_s(self) -> float:
        return float(self.time_s[-1])


@dataclass(frozen=True)
class TimedPath:
    """A path, a time law, and the limits under which it is followed.

    Attributes:
        path: Joint positions over the share of the path [rad].
        law: Share of the path over the share of time, both from 0 to 1.
        limits: Of the joints.
    """

    path: CubicSpline
    law: BSpline
    limits: JointLimits

    def derivatives(self, share_of_time: Shares) -> tuple[Shares, tuple[Joints, Joints, Joints, Joints]]:
        """Share of the path, and joint positions with three derivatives, for a duration of 1 s."""
        s, d1, d2, d3 = (self.law(share_of_time, order)[:, None] for order in range(4))
        s = np.clip(s, 0, 1)
        p0, p1, p2, p3 = (self.path(s[:, 0], order) for order in range(4))
        acceleration = p2 * d1**2 + p1 * d2
        return s[:, 0], (p0, p1 * d1, acceleration, p3 * d1**3 + 3 * p2 * d1 * d2 + p1 * d3)

    def use(self, duration_s: float) -> LimitUse:
        """What a duration would use of each limit."""
        _, (_, velocity, acceleration, jerk) = self.derivatives(self._dense())
        limits = self.limits
        return LimitUse(
            _largest(velocity, limits.velocity_rad_per_s),
            _largest(acceleration, limits.acceleration_rad_per_s2),
            _largest(jerk, limits.jerk_rad_per_s3),
        ).stretched(duration_s)

    def sampled(self, duration_s: float, stretch: float) -> TimedJoints:
        """At 240 Hz; the duration is rounded up to whole steps."""
        steps = int(np.ceil(duration_s * RATE_HZ - 1e-9))
        total_s = steps / RATE_HZ
        shares, (joints, velocity, acceleration, _) = self.derivatives(np.linspace(0, 1, steps + 1))
        return TimedJoints(
            time_s=np.arange(steps + 1) / RATE_HZ,
            joints_rad=joints,
            velocity_rad_per_s=velocity / total_s,
            acceleration_rad_per_s2=acceleration / total_s**2,
            share_of_path=shares,
            stretch=stretch * total_s / duration_s,
            use=self.use(total_s),
        )

    def _dense(self) -> Shares:
        """Times between the knots of law and path, where jerk may jump, several in each interval."""
        knots = np.unique(np.clip(self.law.t, 0, 1))
        fine = np.linspace(0, 1, 1 + SAMPLES_PER_KNOT * len(knots))
        at_path_knots = np.interp(self.path.x, self.law(fine), fine)
        knots = np.union1d(knots, at_path_knots)
        inner = np.linspace(0, 1, SAMPLES_PER_KNOT + 1)[:-1]
        return np.append((knots[:-1, None] + inner * np.diff(knots)[:, None]).ravel(), 1.0)


def smooth_law(shares: Shares) -> BSpline:
    """The B-spline whose coefficients are the samples: smooth, as monotone as they are, at rest at both ends."""
    coefficients = np.concatenate([np.zeros(DEGREE), shares, np.ones(DEGREE)])
    count = len(coefficients) - DEGREE
    knots = np.arange(-DEGREE, count + DEGREE + 1) / count
    return BSpline(knots, coefficients, DEGREE)


def _largest(values: Joints, limit: Float[np.ndarray, " joint"]) -> float:
    return float((np.abs(values) / limit).max())
