"""When to be where on a path: a time law that the arm can follow, from the demonstrations or as fast as it can.

The fastest law comes from toppra (MIT): it is optimal on the given path under limits of velocity and acceleration and
takes milliseconds; ruckig's open version cannot follow waypoints. It knows no jerk: its accelerations jump. Its law is
therefore averaged over a short time, and of the averages, stretched until jerk is within limits, the fastest is taken.
"""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.robot.panda import JointLimits
from geomotion.robot.timed import DEGREE, TimedJoints, TimedPath, smooth_law
from geomotion.types import Float

GRID_POINTS = 1000  # of toppra
WIDTHS_S = np.geomspace(0.008, 0.25, 10)  # over which its law is averaged
STEP_RAD = 1e-3  # rows of a path that are nearer to the last one are passed over
LEVER_M = 0.1  # a radian on the way counts as that much

PathJoints = Float[np.ndarray, "row joint"]
Shares = Float[np.ndarray, " time"]


def like_demonstration(
    joints_rad: PathJoints,
    share_of_path_at_time: Float[np.ndarray, " sample"],
    duration_s: float,
    limits: JointLimits,
) -> TimedJoints:
    """Follow a path with the timing of a demonstration, slower where a limit is in the way, at rest at both ends.

    Args:
        joints_rad: The path; row k of n lies at share k / (n - 1).
        share_of_path_at_time: How much of the path is behind at evenly spaced times, from 0 to 1, never falling. It is
            smoothed over six of these samples.
        duration_s: How long it should take [s].
        limits: Of the joints.

    Raises:
        ShapeMismatch: If there are fewer than four rows, or two samples.
        InvalidSetting: If a number is not finite, the duration not positive, or the shares fall or have other ends.
    """
    _require_shares(share_of_path_at_time)
    if not 0 < duration_s < np.inf:
        raise InvalidSetting("robot.duration_s", duration_s, "a time above 0 s")
    _require_path(joints_rad)
    path = CubicSpline(np.linspace(0, 1, len(joints_rad)), joints_rad)
    motion = TimedPath(path, smooth_law(share_of_path_at_time), limits)
    stretch = max(1.0, motion.use(duration_s).stretch)
    return motion.sampled(stretch * duration_s, stretch)


def fastest(joints_rad: PathJoints, limits: JointLimits, share_of_limits: float = 1.0) -> TimedJoints:
    """Follow a path about as fast as the limits of velocity, acceleration and jerk allow, at rest at both ends.

    Args:
        joints_rad: The path; of rows within 1 mrad of each other, one is taken.
        limits: Of the joints.
        share_of_limits: How much of each limit may be used, above 0 and at most 1.

    Raises:
        ShapeMismatch: If there are fewer than four rows.
        InvalidSetting: If a number is not finite, the path does not move, or the share is out of range.
    """
    _require_path(joints_rad)
    path, limits = _without_pauses(joints_rad), limits.scaled(share_of_limits)
    duration_s, shares = _time_optimal(path, limits)
    best: tuple[float, TimedPath] | None = None
    for width_s in WIDTHS_S:
        count = max(2, round(duration_s / width_s * (DEGREE + 1)))
        motion = TimedPath(
            path, smooth_law(np.interp(np.linspace(0, 1, count), np.linspace(0, 1, len(shares)), shares)), limits
        )
        needed_s = motion.use(1.0).stretch
        if best is None or needed_s < best[0]:
            best = needed_s, motion
    assert best is not None
    return best[1].sampled(best[0], best[0] / duration_s)


def share_of_path(
    positions_m: Float[np.ndarray, "pose 3"], orientations_wxyz: Float[np.ndarray, "pose 4"]
) -> Float[np.ndarray, " pose"]:
    """How much of a path of poses is behind at each, by length, from 0 to 1; a radian counts as 0.1 m.

    Raises:
        InvalidSetting: If the poses do not move.
    """
    turns = Rotation.from_quat(orientations_wxyz, scalar_first=True)
    angles = (turns[1:] * turns[:-1].inv()).magnitude()
    steps = np.hypot(np.linalg.norm(np.diff(positions_m, axis=0), axis=1), LEVER_M * angles)
    behind = np.concatenate([[0.0], np.cumsum(steps)])
    if not behind[-1] > 0:
        raise InvalidSetting("positions_m", "all in one place", "a path that moves")
    share: Float[np.ndarray, " pose"] = behind / behind[-1]
    return share


def _time_optimal(path: CubicSpline, limits: JointLimits) -> tuple[float, Shares]:
    """Duration [s], and shares of the path at evenly spaced times, under limits of velocity and acceleration alone."""
    from toppra import SplineInterpolator
    from toppra.algorithm import TOPPRA
    from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

    both = np.array([-1.0, 1.0])
    constraints = [
        JointVelocityConstraint(limits.velocity_rad_per_s[:, None] * both),
        JointAccelerationConstraint(limits.acceleration_rad_per_s2[:, None] * both),
    ]
    grid = np.linspace(0, 1, GRID_POINTS + 1)
    planner = TOPPRA(constraints, SplineInterpolator(path.x, path(path.x)), gridpoints=grid)
    _, speeds, _ = planner.compute_parameterization(0, 0)
    if speeds is None or not np.isfinite(speeds).all():
        raise InvalidSetting(
            "joints_rad",
            "a path that toppra cannot time",
            "one that is smooth; the demonstrations' timing needs no toppra",
        )
    return _integrated(grid, speeds)


def _integrated(grid: Float[np.ndarray, " point"], speeds: Float[np.ndarray, " point"]) -> tuple[float, Shares]:
    """From speeds over the path, with constant acceleration in between, to shares over time."""
    spans = 2 * np.diff(grid) / (speeds[1:] + speeds[:-1])
    times = np.concatenate([[0.0], np.cumsum(spans)])
    at = np.linspace(0, times[-1], 10 * len(grid))
    here = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(spans) - 1)
    since = at - times[here]
    shares = grid[here] + speeds[here] * since + np.diff(speeds)[here] / spans[here] * since**2 / 2
    return float(times[-1]), np.clip(shares, 0, 1)


def _require_path(joints_rad: PathJoints) -> None:
    if len(joints_rad) < 4:
        raise ShapeMismatch("a path of joint positions", "four rows or more", joints_rad.shape)
    if not np.isfinite(joints_rad).all():
        raise InvalidSetting("joints_rad", "NaN or infinity", "numbers")
    if not np.linalg.norm(joints_rad - joints_rad[0], axis=1).max() > 3 * STEP_RAD:
        raise InvalidSetting("joints_rad", "nearly the same in all rows", "a path that moves")


def _without_pauses(joints_rad: PathJoints) -> CubicSpline:
    """The path through those of its rows that are a step apart: at pauses toppra finds no solution."""
    kept = [0]
    for row in range(1, len(joints_rad)):
        if np.linalg.norm(joints_rad[row] - joints_rad[kept[-1]]) > STEP_RAD:
            kept.append(row)
    kept[-1] = len(joints_rad) - 1
    return CubicSpline(np.array(kept) / kept[-1], joints_rad[kept])


def _require_shares(shares: Shares) -> None:
    if len(shares) < 2:
        raise ShapeMismatch("shares of a path", "two samples or more", shares.shape)
    if not (np.isfinite(shares).all() and shares[0] == 0 and shares[-1] == 1 and (np.diff(shares) >= 0).all()):
        raise InvalidSetting("share_of_path_at_time", shares, "numbers that rise from 0 to 1")
