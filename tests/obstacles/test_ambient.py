"""The soft constraint against Eq. (3.15) and its properties."""

import numpy as np
import pytest
import torch

from geomotion.errors import InvalidSetting
from geomotion.obstacles.ambient import ambient_factor, combine_factors, reach_m
from geomotion.obstacles.solids import Box, Sphere

GAIN, RADIUS = 100.0, 0.05


def states() -> torch.Tensor:
    return torch.rand(1000, 3, generator=torch.Generator().manual_seed(0)).double() - 0.5


def test_around_a_sphere_it_is_the_factor_of_the_thesis():
    ball = Sphere(torch.tensor([0.1, 0.0, 0.05]).double(), RADIUS)
    squares = (states() - ball.reference).square().sum(dim=-1).numpy()
    expected = 1 + GAIN * np.exp(-squares / (2 * RADIUS**2))
    np.testing.assert_allclose(ambient_factor(ball.signed_distance(states()).numpy(), RADIUS, GAIN), expected)


def test_it_falls_with_distance_from_one_plus_gain_to_one():
    distances = np.linspace(-2 * RADIUS, 1.0, 500)
    factors = ambient_factor(distances, RADIUS, GAIN)
    assert (np.diff(factors) <= 0).all()
    assert factors[0] == 1 + GAIN
    assert factors[-1] == 1.0
    assert (factors[distances <= -RADIUS] == 1 + GAIN).all()


def test_a_smaller_distance_never_gives_a_smaller_factor_for_any_body():
    box = Box(torch.zeros(3).double(), [0.3, 0.1, 0.2], 0.01)
    distances = box.signed_distance(states()).numpy()
    at_surface = 1 + GAIN * np.exp(-0.5)
    factors = ambient_factor(distances, box.inradius, GAIN)
    np.testing.assert_array_equal(factors > at_surface, distances < 0)


@pytest.mark.parametrize("tolerance", [0.1, 1e-3, 1e-6])
def test_beyond_its_reach_the_factor_is_within_the_tolerance_of_one(tolerance):
    reach = reach_m(RADIUS, tolerance)
    excess = (ambient_factor(np.array([reach - 1e-6, reach, reach + 1e-6]), RADIUS, GAIN) - 1) / GAIN
    np.testing.assert_allclose(excess[1], tolerance)
    assert excess[0] > tolerance > excess[2]


def test_one_more_obstacle_only_adds_and_their_order_plays_no_part():
    one, other = (ambient_factor(np.linspace(a, 0.5, 100), RADIUS, GAIN) for a in (-0.1, 0.2))
    both = combine_factors([one, other])
    assert (both >= np.maximum(one, other)).all()
    np.testing.assert_allclose(both, combine_factors([other, one]))
    np.testing.assert_allclose(both - 1, (one - 1) + (other - 1))
    np.testing.assert_allclose(combine_factors([one]), one)


def test_numbers_without_meaning_are_refused():
    for radius, gain in ((0.0, 1.0), (0.1, -1.0)):
        with pytest.raises(InvalidSetting, match="radius_m, gain"):
            ambient_factor(np.zeros(1), radius, gain)
    for radius, tolerance in ((0.0, 0.1), (0.1, 0.0), (0.1, 1.0)):
        with pytest.raises(InvalidSetting, match="tolerance"):
            reach_m(radius, tolerance)
