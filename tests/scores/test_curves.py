"""Distances between curves against closed forms and against textbook recursions."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from geomotion.scores.curves import (
    discrete_frechet,
    dtwd_per_point,
    dtwd_sum,
    dynamic_time_warping,
    end_point_error,
    relative_error,
    root_mean_square_error,
    start_error,
)

SEEDS = range(4)


def random_walk(seed: int, points: int, dim: int = 2) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(points, dim)).cumsum(axis=0)


def rigid_motion(curve: np.ndarray, seed: int) -> np.ndarray:
    generator = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(generator.normal(size=(curve.shape[1],) * 2))
    return curve @ rotation.T + generator.normal(size=curve.shape[1])


def line(points: int, height: float = 0.0) -> np.ndarray:
    return np.stack([np.linspace(0, 1, points), np.full(points, height)], axis=1)


def recursion(curve: np.ndarray, other: np.ndarray, combine: Callable[[float, float], float]) -> float:
    """The textbook programme, cell by cell."""

    @cache
    def best(i: int, j: int) -> float:
        cost = float(np.linalg.norm(curve[i] - other[j]))
        before = [best(k, l) for k, l in ((i - 1, j - 1), (i - 1, j), (i, j - 1)) if k >= 0 and l >= 0]
        return combine(cost, min(before)) if before else cost

    return best(len(curve) - 1, len(other) - 1)


DISTANCES = {
    "dtwd_sum": dtwd_sum,
    "dtwd_per_point": dtwd_per_point,
    "dtw": lambda one, other: dynamic_time_warping(one, other).sum,
    "frechet": discrete_frechet,
}


@pytest.mark.parametrize("distance", DISTANCES.values(), ids=DISTANCES)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_distance_is_symmetric_positive_and_unmoved_by_rigid_motion(distance, seed):
    one, other = random_walk(seed, 13, 3), random_walk(seed + 100, 8, 3)
    value = distance(one, other)
    assert value > 0
    np.testing.assert_allclose(distance(other, one), value)
    np.testing.assert_allclose(distance(rigid_motion(one, seed), rigid_motion(other, seed)), value)
    assert distance(one, one) == 0


def test_dtwd_of_parallel_lines_counts_every_point_of_both():
    one, other = line(11), line(11, height=0.3)
    np.testing.assert_allclose(dtwd_sum(one, other), 22 * 0.3)
    np.testing.assert_allclose(dtwd_per_point(one, other), 2 * 0.3)


def test_dtwd_per_point_divides_each_direction_by_its_own_number_of_points():
    one, other = line(2), np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 3.0]])
    np.testing.assert_allclose(dtwd_sum(one, other), 3.0)
    np.testing.assert_allclose(dtwd_per_point(one, other), 0 / 2 + 3 / 3)


def test_dtwd_ignores_the_order_of_points_and_real_time_warping_does_not():
    curve = random_walk(0, 20)
    assert dtwd_sum(curve, curve[::-1]) == 0
    assert dynamic_time_warping(curve, curve[::-1]).sum > 1


def test_time_warping_by_hand():
    one, other = np.array([[0.0], [1.0], [3.0]]), np.array([[0.0], [3.0]])
    alignment = dynamic_time_warping(one, other)  # 0-0, 1-0, 3-3
    assert (alignment.sum, alignment.pairs) == (1.0, 3)
    np.testing.assert_allclose(alignment.mean, 1 / 3)


def test_time_warping_prefers_the_shortest_of_equally_good_paths():
    standing = np.zeros((4, 2))
    assert dynamic_time_warping(standing, standing).pairs == 4


@pytest.mark.parametrize(("n", "m"), [(1, 1), (1, 6), (6, 1), (7, 7), (9, 5), (5, 9)])
@pytest.mark.parametrize("seed", SEEDS)
def test_anti_diagonals_give_what_the_textbook_recursion_gives(n, m, seed):
    one, other = random_walk(seed, n), random_walk(seed + 50, m)
    np.testing.assert_allclose(
        dynamic_time_warping(one, other).sum, recursion(one, other, lambda cost, before: cost + before)
    )
    np.testing.assert_allclose(discrete_frechet(one, other), recursion(one, other, max))


def test_frechet_distance_of_parallel_lines_is_their_distance():
    np.testing.assert_allclose(discrete_frechet(line(30), line(30, height=0.2)), 0.2)


def test_frechet_distance_sees_a_detour_that_nearest_points_do_not():
    there_and_back = np.concatenate([line(50), line(50)[::-1], line(50)])
    assert dtwd_per_point(there_and_back, line(50)) < 1e-12
    np.testing.assert_allclose(discrete_frechet(there_and_back, line(50)), 0.5, atol=0.02)


def test_errors_at_the_ends_and_at_equal_times():
    curve = line(5)
    shifted = curve + np.array([3.0, 4.0])
    assert start_error(shifted, curve) == end_point_error(shifted, curve) == 5.0
    np.testing.assert_allclose(root_mean_square_error(shifted, curve), 5.0)


def test_relative_error_of_the_zero_field_is_one_and_scales_with_the_error():
    recorded = random_walk(1, 40)
    np.testing.assert_allclose(relative_error(np.zeros_like(recorded), recorded), 1.0)
    np.testing.assert_allclose(relative_error(0.9 * recorded, recorded), 0.1)


def test_a_diverged_curve_is_not_mistaken_for_a_good_one():
    diverged = np.full((4, 2), np.nan)
    assert np.isnan(dtwd_per_point(diverged, line(4)))
    assert not np.isfinite(dynamic_time_warping(diverged, line(4)).sum)
    assert not np.isfinite(discrete_frechet(diverged, line(4)))
