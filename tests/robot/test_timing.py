"""Time laws: limits hold and are used, the path is kept, both ends rest."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.robot.inverse_kinematics import solve_path
from geomotion.robot.panda import LIMITS
from geomotion.robot.timed import RATE_HZ, LimitUse
from geomotion.robot.timing import fastest, like_demonstration, share_of_path

from .conftest import TASKS, arc

HASTY_S, CALM_S = 0.2, 8.0
EVEN = np.linspace(0, 1, 50)


def late(count: int = 50) -> np.ndarray:
    """A demonstration that waits, moves, and waits again."""
    return np.clip((np.linspace(0, 1, count) - 0.4) / 0.3, 0, 1)


MOTIONS = {
    "calm": lambda: like_demonstration(arc(), EVEN, CALM_S, LIMITS),
    "hasty": lambda: like_demonstration(arc(), late(), HASTY_S, LIMITS),
    "fastest": lambda: fastest(arc(), LIMITS),
    "careful": lambda: fastest(arc(), LIMITS, share_of_limits=0.3),
}


def differences(motion) -> list[np.ndarray]:
    """Velocity, acceleration and jerk by differences of the joint positions, as a robot's controller sees them."""
    found, values = [], motion.joints_rad
    for _ in range(3):
        values = np.diff(values, axis=0) * RATE_HZ
        found.append(values)
    return found


@pytest.mark.parametrize("kind", MOTIONS)
def test_no_joint_exceeds_a_limit(kind):
    motion = MOTIONS[kind]()
    limits = LIMITS.scaled(0.3) if kind == "careful" else LIMITS
    bounds = (limits.velocity_rad_per_s, limits.acceleration_rad_per_s2, limits.jerk_rad_per_s3)
    for values, bound in zip(differences(motion), bounds, strict=True):
        assert (np.abs(values) <= bound * (1 + 1e-6)).all()
    assert max(motion.use.velocity, motion.use.acceleration, motion.use.jerk) <= 1 + 1e-9


@pytest.mark.parametrize("kind", MOTIONS)
def test_the_path_is_not_left_and_never_walked_back(kind):
    motion, path = MOTIONS[kind](), CubicSpline(np.linspace(0, 1, 60), arc())
    np.testing.assert_allclose(motion.joints_rad, path(motion.share_of_path), atol=1e-12)
    assert (np.diff(motion.share_of_path) >= -1e-12).all()
    np.testing.assert_allclose(motion.joints_rad[[0, -1]], arc()[[0, -1]], atol=1e-12)


@pytest.mark.parametrize("kind", MOTIONS)
def test_both_ends_are_at_rest(kind):
    motion = MOTIONS[kind]()
    assert np.abs(motion.velocity_rad_per_s[[0, -1]]).max() < 1e-9
    assert np.abs(motion.acceleration_rad_per_s2[[0, -1]]).max() < 1e-6


@pytest.mark.parametrize("kind", MOTIONS)
def test_velocity_and_acceleration_are_derivatives_of_the_positions(kind):
    motion = MOTIONS[kind]()
    spline = CubicSpline(motion.time_s, motion.joints_rad)
    np.testing.assert_allclose(np.diff(motion.time_s), 1 / RATE_HZ)
    scale = np.abs(motion.velocity_rad_per_s).max()
    np.testing.assert_allclose(spline(motion.time_s, 1)[2:-2], motion.velocity_rad_per_s[2:-2], atol=1e-2 * scale)
    middle = motion.velocity_rad_per_s[1:-1]
    slopes = (motion.velocity_rad_per_s[2:] - motion.velocity_rad_per_s[:-2]) * RATE_HZ / 2
    assert middle.shape == slopes.shape
    scale = np.abs(motion.acceleration_rad_per_s2).max()
    assert np.median(np.abs(slopes - motion.acceleration_rad_per_s2[1:-1])) < 2e-2 * scale


def test_a_calm_demonstration_keeps_its_duration_and_its_timing():
    motion = like_demonstration(arc(), EVEN, CALM_S, LIMITS)
    assert motion.stretch == pytest.approx(1)
    assert motion.duration_s == pytest.approx(CALM_S, abs=1 / RATE_HZ)
    assert max(motion.use.velocity, motion.use.acceleration, motion.use.jerk) < 1
    delayed = like_demonstration(arc(), late(), CALM_S, LIMITS)
    for time_share, share in ((0.3, 0.0), (0.55, 0.5), (0.8, 1.0)):
        assert np.interp(time_share * CALM_S, delayed.time_s, delayed.share_of_path) == pytest.approx(share, abs=0.03)


def test_a_hasty_demonstration_is_stretched_by_no_more_than_it_must():
    motion = like_demonstration(arc(), late(), HASTY_S, LIMITS)
    assert motion.stretch > 2
    assert motion.duration_s == pytest.approx(motion.stretch * HASTY_S)
    # 1/240 s less, the rounding, and one of the limits would be exceeded
    factor = (motion.duration_s - 1 / RATE_HZ) / motion.duration_s
    assert motion.use.stretched(factor).stretch > 1


def test_the_fastest_motion_uses_a_limit_fully_and_little_time_more_than_without_jerk_limits():
    motion = fastest(arc(), LIMITS)
    assert motion.use.stretch > 0.98
    assert 1 <= motion.stretch < 1.1  # of toppra's optimum under limits of velocity and acceleration alone
    assert motion.duration_s < like_demonstration(arc(), EVEN, HASTY_S, LIMITS).duration_s


def test_more_rows_of_the_same_path_make_little_difference():
    assert fastest(arc(1500), LIMITS).duration_s == pytest.approx(fastest(arc(60), LIMITS).duration_s, rel=0.03)


@pytest.mark.parametrize("task", TASKS)
def test_recorded_tasks_have_a_fastest_motion_within_limits(task, recorded):
    motion = fastest(solve_path(*recorded(task)).joints_rad, LIMITS)
    assert motion.use.stretch == pytest.approx(1, abs=0.01)
    assert 3 < motion.duration_s < 10
    assert motion.stretch < 1.6


def test_more_careful_is_slower():
    durations = [fastest(arc(), LIMITS, share_of_limits=share).duration_s for share in (1.0, 0.5, 0.2)]
    assert all(slower > 1.2 * faster for faster, slower in pairwise(durations))


@pytest.mark.parametrize("where", [0, 30, 59])
def test_the_fastest_motion_does_not_wait_where_rows_repeat(where):
    waiting = np.insert(arc(), [where] * 10, arc()[where], axis=0)
    assert fastest(waiting, LIMITS).duration_s < 1.5 * fastest(arc(), LIMITS).duration_s
    np.testing.assert_allclose(fastest(waiting, LIMITS).joints_rad[[0, -1]], arc()[[0, -1]], atol=1e-12)


def test_stretching_divides_by_powers():
    use = LimitUse(velocity=2.0, acceleration=9.0, jerk=64.0)
    assert use.stretch == pytest.approx(4)
    assert use.stretched(2.0) == LimitUse(1.0, 2.25, 8.0)
    assert use.stretched(use.stretch).stretch == pytest.approx(1)


def test_the_share_of_a_path_counts_metres_and_radians():
    positions = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0]])
    turned = np.array([np.cos(0.5), 0, 0, np.sin(0.5)])  # one radian about z
    quaternions = np.stack([np.array([1.0, 0, 0, 0]), np.array([-1.0, 0, 0, 0]), turned, turned])
    np.testing.assert_allclose(share_of_path(positions, quaternions), np.arange(4) / 3)


def test_what_has_no_timing_is_refused():
    with pytest.raises(ShapeMismatch, match="four rows"):
        fastest(arc()[:3], LIMITS)
    with pytest.raises(InvalidSetting, match="path that moves"):
        fastest(np.tile(arc()[:1], (10, 1)), LIMITS)
    with pytest.raises(InvalidSetting, match="NaN"):
        like_demonstration(np.full((10, 7), np.nan), EVEN, CALM_S, LIMITS)
    with pytest.raises(InvalidSetting, match="a time above 0 s"):
        like_demonstration(arc(), EVEN, 0.0, LIMITS)
    for shares in (EVEN[::-1].copy(), EVEN[1:], np.array([0.0, 0.7, 0.3, 1.0])):
        with pytest.raises(InvalidSetting, match="rise from 0 to 1"):
            like_demonstration(arc(), shares, CALM_S, LIMITS)
    with pytest.raises(ShapeMismatch, match="two samples"):
        like_demonstration(arc(), np.zeros(1), CALM_S, LIMITS)
    with pytest.raises(InvalidSetting, match="limit_share"):
        fastest(arc(), LIMITS, share_of_limits=0.0)
    with pytest.raises(InvalidSetting, match="all in one place"):
        share_of_path(np.zeros((3, 3)), np.tile([1.0, 0, 0, 0], (3, 1)))
