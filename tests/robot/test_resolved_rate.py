"""Joint velocities for velocities of the tip: they do what is wanted, and no more than limits allow."""

import numpy as np
import pytest

from geomotion.robot import panda
from geomotion.robot.chain import panda_chain
from geomotion.robot.pose_search import LEVER_M
from geomotion.robot.resolved_rate import POSTURE_PER_S, ResolvedRate, TipVelocity, allowed, damped_inverse

PERIOD_S = 1 / 60
CHAIN = panda_chain("grasp_target")
NOTHING = np.zeros(3)
WANTED = TipVelocity(np.array([0.05, -0.08, 0.03]), np.array([0.1, 0.2, -0.1]))


@pytest.fixture
def resolve() -> ResolvedRate:
    return ResolvedRate(CHAIN, panda.LIMITS, panda.HOME_RAD)


def tip_velocity(joints_rad: np.ndarray, velocity_rad_per_s: np.ndarray) -> np.ndarray:
    """By central differences of the pose along the motion: velocity, and angular velocity times the lever."""
    step = 1e-6
    before, after = (CHAIN.pose_and_jacobian(joints_rad + h * velocity_rad_per_s)[0] for h in (-step, step))
    skew = (after[:3, :3] - before[:3, :3]) / (2 * step) @ CHAIN.pose_and_jacobian(joints_rad)[0][:3, :3].T
    omega = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    return np.concatenate([(after[:3, 3] - before[:3, 3]) / (2 * step), LEVER_M * omega])


def test_the_tip_moves_as_wanted_and_yields_on_top(resolve):
    joints = panda.HOME_RAD + 0.1
    yielding = np.array([0.0, 0.02, 0.0])
    found = np.zeros(7)
    for _ in range(5):  # periods in which it gets up to speed
        found = resolve(joints, WANTED, yielding, found, PERIOD_S)
    np.testing.assert_allclose(tip_velocity(joints, found), WANTED.task + np.array([0, 0.02, 0, 0, 0, 0]), atol=1e-6)
    assert not resolve.is_short(joints, WANTED, yielding, found)
    assert resolve.is_short(joints, WANTED, yielding, 0.5 * found)


def test_what_the_tip_leaves_free_leads_to_the_posture(resolve):
    free = np.linalg.svd(CHAIN.pose_and_jacobian(panda.HOME_RAD)[1])[2][-1]
    joints = panda.HOME_RAD + 0.05 * free
    found = resolve(joints, TipVelocity(NOTHING, NOTHING), NOTHING, np.zeros(7), PERIOD_S)
    np.testing.assert_allclose(tip_velocity(joints, found), 0, atol=1e-6)
    assert found @ (panda.HOME_RAD - joints) == pytest.approx(POSTURE_PER_S * 0.05**2, rel=0.01)


def test_velocities_of_joints_are_kept_and_only_clipped(resolve):
    wanted = np.array([0.1, -0.1, 0.2, 0.3, 5.0, 0.0, 0.0])
    possible = np.minimum(wanted, panda.LIMITS.velocity_rad_per_s)
    np.testing.assert_allclose(resolve(panda.HOME_RAD, wanted, NOTHING, possible, PERIOD_S), possible)


def test_other_joints_make_up_for_one_that_may_not_move(resolve):
    slowest, fastest = -panda.LIMITS.velocity_rad_per_s, panda.LIMITS.velocity_rad_per_s.copy()
    _, J = CHAIN.pose_and_jacobian(panda.HOME_RAD)
    fastest[0] = slowest[0] = 0.0
    found = resolve._redistributed(J, np.array([0.0, 0.1, 0, 0, 0, 0]), np.zeros(7), slowest, fastest)
    assert found[0] == 0
    np.testing.assert_allclose(J @ found, [0, 0.1, 0, 0, 0, 0], atol=1e-9)


def test_near_a_singularity_velocities_stay_small():
    J = np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 1e-9])
    assert np.abs(damped_inverse(J)).max() < 1.1
    np.testing.assert_allclose(damped_inverse(np.eye(6)), np.eye(6))


@pytest.mark.parametrize("target_rad_per_s", [10.0, -10.0])
def test_limits_of_position_velocity_and_acceleration_are_never_exceeded(target_rad_per_s):
    limits, joints, velocity = panda.LIMITS, panda.HOME_RAD.copy(), np.zeros(7)
    for _ in range(300):
        before = velocity
        velocity = np.clip(target_rad_per_s, *allowed(joints, before, PERIOD_S, limits))
        joints = joints + PERIOD_S * velocity
        assert (np.abs(velocity) <= limits.velocity_rad_per_s + 1e-12).all()
        assert (np.abs(velocity - before) <= limits.acceleration_rad_per_s2 * PERIOD_S * (1 + 1e-9)).all()
        assert limits.margin_rad(joints[None])[0] > -1e-9
    assert (np.abs(velocity) < 0.05).all()  # at the limits by now
