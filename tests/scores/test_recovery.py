"""Recovery from disturbances of known decay."""

import math

import numpy as np
import pytest

from geomotion.scores.pushes import Path
from geomotion.scores.recovery import Deviation, recovery

TIMES_S = np.linspace(0, 10, 2401)


def decaying(rate: float, size_m: float, released_s: float) -> Deviation:
    """A push that grows over a quarter of a second and decays from then on."""
    grown = np.clip((TIMES_S - released_s + 0.25) / 0.25, 0, 1)
    aside = size_m * grown * np.exp(-rate * np.maximum(TIMES_S - released_s, 0))
    return Deviation(TIMES_S, aside, 3 * aside)


def test_times_and_rates_are_those_of_the_decay():
    found = recovery(decaying(0.8, 0.05, 2.0), 1.75, 2.0, 10.0)
    assert found.pushed_m == pytest.approx(0.05, rel=1e-3)
    assert found.back_s[25] == pytest.approx(math.log(2) / 0.8, abs=0.01)
    assert found.back_s[10] == pytest.approx(math.log(5) / 0.8, abs=0.01)
    assert found.claimed_rate_per_s == pytest.approx(0.8, rel=0.01)


def test_what_is_not_back_before_the_next_push_never_is():
    found = recovery(decaying(0.8, 0.05, 2.0), 1.75, 2.0, 3.0)
    assert found.back_s[25] == pytest.approx(math.log(2) / 0.8, abs=0.01)
    assert found.back_s[10] == math.inf
    assert math.isnan(found.claimed_rate_per_s)


def test_a_disturbance_at_the_very_end_leaves_nothing_to_judge():
    found = recovery(decaying(0.8, 0.05, 9.9), 9.7, 10.0, 10.0)
    assert found.back_s[10] == math.inf
    assert found.pushed_m == pytest.approx(0.05, rel=0.01)


def test_distances_are_to_the_path_between_its_points():
    path = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    distances = Path(path).distances(np.array([[0.5, 0.03, 0.0], [1.1, 0.0, 0.0]]))
    np.testing.assert_allclose(distances, [0.03, 0.1])
