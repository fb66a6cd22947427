"""The swivel angle of the Panda's elbow."""

import numpy as np
import pytest

from geomotion.robot import panda
from geomotion.robot.chain import panda_chain
from geomotion.robot.swivel import swivel_and_gradient, swivel_rad


def configurations(count, seed=0):
    return np.random.default_rng(seed).uniform(panda.LIMITS.lower_rad, panda.LIMITS.upper_rad, size=(count, 7))


def test_the_elbow_is_up_in_the_vertical_plane_and_goes_to_the_right_for_positive_angles():
    forwards = np.array([0.0, np.pi / 6, 0.0, -2 * np.pi / 3, 0.0, 5 * np.pi / 6, 0.0])
    assert swivel_rad(forwards) == pytest.approx(0, abs=1e-9)
    to_the_right = forwards + np.array([0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0])
    wrist_moved = swivel_rad(to_the_right)
    assert np.sign(wrist_moved) == np.sign(swivel_rad(forwards - 0.3 * np.eye(7)[0]))


def test_turning_the_whole_arm_about_its_base_keeps_the_swivel():
    q = configurations(20)
    q[:, 0] = 0.0
    turned = q.copy()
    turned[:, 0] = 1.3
    np.testing.assert_allclose(swivel_rad(turned), swivel_rad(q), atol=1e-9)


def test_the_gradient_is_that_of_the_angle():
    chain = panda_chain("grasp_target")
    for q in configurations(20):
        angle, gradient = swivel_and_gradient(chain, chain.frames(q))
        assert angle == pytest.approx(float(swivel_rad(q)), abs=1e-12)
        around = q + 1e-6 * np.concatenate([np.eye(7), -np.eye(7)])
        forth, back = swivel_rad(around).reshape(2, 7)
        np.testing.assert_allclose(gradient, (forth - back) / 2e-6, atol=1e-6 * max(1, np.abs(gradient).max()))
