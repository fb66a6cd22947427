"""Random joint solutions of poses."""

import numpy as np
import pytest

from geomotion.errors import InvalidSetting
from geomotion.robot import panda
from geomotion.robot.chain import panda_chain
from geomotion.robot.random_solutions import random_solutions
from geomotion.robot.swivel import swivel_rad

DOWN = np.array([[0.0, 1.0, 0.0, 0.0]])
PLACE_M = np.array([[0.5, 0.0, 0.3]])


def test_solutions_take_the_pose_within_the_limits_in_many_ways():
    found = random_solutions(PLACE_M, DOWN, 30)
    assert found.reached.shape == (1, 30) and found.reached.mean() > 0.7
    joints = found.joints_rad[found.reached]
    assert panda.LIMITS.margin_rad(joints).min() >= 0
    position_m, orientation = panda_chain("grasp_target").pose(joints)
    np.testing.assert_allclose(position_m, np.broadcast_to(PLACE_M, position_m.shape), atol=1e-3)
    np.testing.assert_allclose(np.abs(orientation @ DOWN[0]), 1, atol=1e-4)
    assert np.ptp(swivel_rad(joints)) > np.pi / 2


def test_the_same_seed_draws_the_same_solutions_and_another_one_others():
    first, again, other = (random_solutions(PLACE_M, DOWN, 3, seed=seed).joints_rad for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0.1


def test_poses_out_of_reach_have_none():
    positions_m = np.concatenate([PLACE_M, [[2.0, 0.0, 0.3]]])
    found = random_solutions(positions_m, np.repeat(DOWN, 2, axis=0), 5)
    assert found.reached[0].any() and not found.reached[1].any()


def test_at_least_one_solution_has_to_be_asked_for():
    with pytest.raises(InvalidSetting, match="count"):
        random_solutions(PLACE_M, DOWN, 0)
