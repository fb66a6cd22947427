"""Baselines on demonstrations whose average and neighbours are known."""

import numpy as np

from geomotion.scores.baselines import (
    averaged_curve,
    distances_between,
    distances_to_nearest,
    nearest_neighbour_velocities,
)


def line(points: int, height: float) -> np.ndarray:
    return np.stack([np.linspace(0, 1, points), np.full(points, height)], axis=1)


HEIGHTS = (0.0, 1.0, 4.0)
LINES = [line(30, height) for height in HEIGHTS]


def test_every_pair_of_different_demonstrations_counts_once():
    np.testing.assert_allclose(distances_between(LINES), [2 * 1, 2 * 4, 2 * 3])


def test_the_nearest_demonstration_is_another_one():
    np.testing.assert_allclose(distances_to_nearest(LINES, LINES), [2 * 1, 2 * 1, 2 * 3])
    np.testing.assert_allclose(distances_to_nearest([line(30, 3.5)], LINES), [2 * 0.5])


def test_an_equal_copy_is_another_demonstration():
    assert distances_to_nearest([LINES[0].copy()], LINES) == [0.0]


def test_the_averaged_curve_compares_equal_shares_of_the_durations():
    slow_time, fast_time = np.linspace(0, 8, 30), np.linspace(0, 2, 30)
    average = averaged_curve([LINES[0], LINES[1]], [slow_time, fast_time])
    np.testing.assert_allclose(average, line(30, 0.5))


def test_the_averaged_curve_follows_time_not_the_number_of_the_point():
    time_s = np.array([0.0, 1.0, 4.0])
    waiting_late = np.array([[0.0], [3.0], [4.0]])
    average = averaged_curve([waiting_late], [time_s])
    np.testing.assert_allclose(average[:, 0], [0.0, 3 + 1 / 3, 4.0])


def test_the_nearest_known_state_lends_its_velocity():
    known = np.array([[0.0, 0.0], [1.0, 0.0]])
    velocities = np.array([[1.0, 2.0], [3.0, 4.0]])
    found = nearest_neighbour_velocities(np.array([[0.9, 0.3], [-5.0, 0.0]]), known, velocities)
    np.testing.assert_array_equal(found, [[3.0, 4.0], [1.0, 2.0]])
