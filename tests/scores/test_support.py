"""Steps inside the demonstration region, Eq. (6.10), for rollouts whose positions are known."""

import numpy as np
import pytest

from geomotion.scores.grids import Box
from geomotion.scores.support import RegionProtocol, demonstration_region, inside, judge_region

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5]])
BOX = Box(np.array([-1.0, -1.0]), np.array([2.0, 2.0]))


def stay(starts, times_s):
    return np.repeat(starts[:, None], len(times_s), axis=1)


def move_right_by_one_each_second(starts, times_s):
    return starts[:, None] + np.stack([times_s, np.zeros_like(times_s)], axis=1)


def test_the_region_is_the_convex_hull_widened_by_the_margin():
    assert demonstration_region(SQUARE, 0.0).area == pytest.approx(1.0)
    assert demonstration_region(SQUARE, 0.1).area == pytest.approx(1 + 4 * 0.1 + np.pi * 0.1**2, rel=1e-3)


def test_states_at_rest_are_inside_all_the_time_or_never():
    protocol = RegionProtocol(starts_per_axis=4, steps=10, step_s=0.1, margin_m=0.01)
    evaluation = judge_region(stay, SQUARE, BOX, protocol)
    # grid coordinates -1, 0, 1, 2: the four corners of the square lie inside its widened hull
    assert evaluation.scores["region.steps_inside"].value == pytest.approx(10 * 4 / 16)
    assert evaluation.scores["region.steps_outside"].value == pytest.approx(10 * 12 / 16)
    assert evaluation.scores["region.steps_inside"].spread == pytest.approx(10 * np.sqrt(3) / 4)
    assert evaluation.arrays["region_inside"].sum() == 40


def test_steps_follow_time_and_the_start_is_one_of_them():
    protocol = RegionProtocol(starts_per_axis=2, steps=31, step_s=0.1, margin_m=0.0)
    band = Box(np.array([-1.0, 0.5]), np.array([-1.0, 0.5]))
    evaluation = judge_region(move_right_by_one_each_second, SQUARE, band, protocol)
    np.testing.assert_allclose(evaluation.arrays["region_rollouts"][0, [0, -1], 0], [-1.0, 2.0])
    inside_at = np.flatnonzero(evaluation.arrays["region_inside"][0])
    np.testing.assert_array_equal(inside_at, np.arange(11, 20))  # 0 < x < 1
    assert "100 ms" in evaluation.scores["region.steps_inside"].note


def test_diverged_states_are_outside():
    trajectories = np.array([[[0.5, 0.5], [np.nan, 0.5], [np.inf, np.inf]]])
    np.testing.assert_array_equal(inside(demonstration_region(SQUARE, 0.0), trajectories), [[True, False, False]])


def test_other_dimensions_and_straight_demonstrations_are_left_out_with_a_reason():
    protocol = RegionProtocol(3, 5, 0.1, 0.0)
    cube = Box(np.zeros(3), np.ones(3))
    assert "two dimensions" in judge_region(stay, np.random.rand(9, 3), cube, protocol).omitted["region"]
    assert "line" in judge_region(stay, np.linspace([0, 0], [1, 1], 9), BOX, protocol).omitted["region"]
