import numpy as np

from geomotion.config import StraightLinesDataset
from geomotion.demos import readers


def generate(**settings):
    return readers.read(StraightLinesDataset(name="generated/straight_lines", **settings))


def test_every_demonstration_is_a_straight_line_to_the_origin_at_one_rate():
    for one in generate().trajectories:
        position_m, velocity = one.channels["position_m"], one.channels["velocity_m_per_s"]
        rates = -velocity / position_m
        np.testing.assert_allclose(rates, rates[0, 0])
        np.testing.assert_allclose(np.linalg.norm(position_m[-1]) / np.linalg.norm(position_m[0]), 0.01)
        np.testing.assert_allclose(np.gradient(position_m, one.time_s, axis=0)[1:-1], velocity[1:-1], rtol=1e-3)


def test_starts_surround_the_goal():
    angles = np.sort([np.arctan2(*one.channels["position_m"][0]) for one in generate().trajectories])
    assert np.diff([*angles, angles[0] + 2 * np.pi]).max() < np.pi / 2


def test_the_seed_decides_and_further_repetitions_change_nothing():
    few, many, other = generate(demos=3), generate(demos=5), generate(demos=3, seed=1)
    for number in range(3):
        first = few[number].channels["position_m"]
        np.testing.assert_array_equal(first, many[number].channels["position_m"])
        assert np.abs(first - other[number].channels["position_m"]).max() > 1e-4
