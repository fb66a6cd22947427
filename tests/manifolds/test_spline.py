"""Cubic splines through graph paths."""

import numpy as np
import pytest

from geomotion.manifolds.spline import fit_spline, polyline


def zigzag(points: int = 60) -> np.ndarray:
    """A path such as graphs give: a smooth curve on a grid."""
    t = np.linspace(0, 1, points)
    return np.round(np.stack([20 * t, 8 * np.sin(4 * t)], axis=1)) / 10 + np.array([5.0, -3.0])


@pytest.mark.parametrize("control_points", [4, 12, 48])
def test_ends_are_met_exactly(control_points):
    path = zigzag()
    spline = fit_spline(path, control_points)
    np.testing.assert_allclose(spline.points(100)[[0, -1]], path[[0, -1]], atol=1e-13)
    np.testing.assert_array_equal(spline.coefficients[[0, -1]], path[[0, -1]])
    assert spline.points(100).shape == (100, 2) and spline.basis(100).shape == (100, control_points)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("points", [2, 3, 7, 100])
def test_straight_paths_stay_straight_and_even(points, dim):
    ends = np.array([[5.0, 9.0, -2.0], [6.0, -4.0, 3.0]])[:, :dim]
    spline = fit_spline(np.linspace(*ends, points), 12)
    np.testing.assert_allclose(spline.points(50), np.linspace(*ends, 50), atol=1e-10)


def test_basis_functions_sum_to_one_and_are_local():
    basis = fit_spline(zigzag(), 12).basis(300)
    np.testing.assert_allclose(basis.sum(axis=1), 1)
    assert (basis >= 0).all() and ((basis > 0).sum(axis=1) <= 4).all()


def test_enough_control_points_follow_the_path():
    path, errors = zigzag(), []
    for control_points in (6, 12, 24):
        curve = fit_spline(path, control_points).points(400)
        errors.append(np.linalg.norm(path[:, None] - curve, axis=2).min(axis=1).max())
    assert errors[0] > errors[-1]
    assert errors[-1] < 0.1  # one cell


@pytest.mark.parametrize("seed", range(20))
def test_short_paths_stay_near_their_nodes_wherever_they_are(seed):
    generator = np.random.default_rng(seed)
    path = 1000 + generator.integers(-1, 2, size=(generator.integers(2, 5), 2)).cumsum(axis=0).astype(float)
    curve = fit_spline(path, 12).points(50)
    assert np.linalg.norm(curve[:, None] - path, axis=2).min(axis=1).max() < 1.5


def test_moving_turning_and_scaling_a_path_does_the_same_to_its_spline():
    path, angle = zigzag(), 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    moved = fit_spline(3 * path @ turn.T + np.array([100.0, -7.0]), 12)
    expected = 3 * fit_spline(path, 12).coefficients @ turn.T + np.array([100.0, -7.0])
    np.testing.assert_allclose(moved.coefficients, expected, rtol=1e-9)
    backward = fit_spline(path[::-1], 12)
    np.testing.assert_allclose(backward.points(50), fit_spline(path, 12).points(50)[::-1], atol=1e-9)


def test_a_polyline_is_even_in_length_and_keeps_its_corners():
    corner = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 1.0]])
    points = polyline(corner, 9)
    np.testing.assert_allclose(np.linalg.norm(np.diff(points, axis=0), axis=1), 0.5)
    np.testing.assert_allclose(points[[0, 6, 8]], corner)


def test_a_path_of_one_place_is_a_curve_of_one_place():
    for points in (np.ones((1, 2)), np.ones((2, 2))):
        np.testing.assert_array_equal(polyline(points, 5), np.ones((5, 2)))
    np.testing.assert_allclose(fit_spline(np.ones((2, 2)), 12).points(5), np.ones((5, 2)))
