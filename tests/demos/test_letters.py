import numpy as np
import pytest
import shapely

from geomotion.config import LETTERS, LettersDataset
from geomotion.demos.preprocessing import estimate_velocity
from geomotion.demos.readers import read
from geomotion.errors import InvalidSetting, UnknownName


def letters(letter="j", **settings):
    return read(LettersDataset(name=f"letters/{letter}", letter=letter, **settings))


def paths(demonstrations):
    return [trajectory.channels["position_m"] for trajectory in demonstrations.trajectories]


@pytest.mark.parametrize("letter", LETTERS)
@pytest.mark.parametrize("variation", [0.0, 1.0, 3.0])
def test_no_letter_crosses_itself(letter, variation):
    for path in paths(letters(letter, demos=10, variation=variation, seed=3)):
        assert shapely.LineString(path).is_simple


@pytest.mark.parametrize("letter", LETTERS)
def test_all_repetitions_end_at_the_origin_and_at_rest(letter):
    demonstrations = letters(letter, demos=5)
    for trajectory in demonstrations.trajectories:
        path = trajectory.channels["position_m"]
        np.testing.assert_array_equal(path[-1], [0, 0])
        speed = np.linalg.norm(estimate_velocity(trajectory.time_s, path), axis=1)
        assert max(speed[0], speed[-1]) < 1e-3 * speed.max()
        assert (speed[15:-1] > 0).all()  # once moving, it stops only at the end


@pytest.mark.parametrize("letter", LETTERS)
def test_letters_are_as_big_and_long_as_asked(letter):
    demonstrations = letters(letter, demos=20, size_m=0.2, duration_s=5.0)
    heights = [np.ptp(path[:, 1]) for path in paths(demonstrations)]
    durations = [trajectory.duration_s for trajectory in demonstrations.trajectories]
    assert 0.8 * 0.2 < np.mean(heights) < 1.35 * 0.2
    assert 4.5 < np.mean(durations) < 5.5
    assert 0.05 < np.std(durations) / 5 < 0.25


@pytest.mark.parametrize("letter", LETTERS)
def test_repetitions_differ_about_as_much_as_those_of_people(letter):
    repetitions = paths(letters(letter, demos=50))
    spread = np.linalg.norm(np.std([path[0] for path in repetitions], axis=0))
    extent = np.mean([np.ptp(path, axis=0).max() for path in repetitions])
    assert 0.02 < spread / extent < 0.13  # the same number for shapes of LASA: 0.02 to 0.13, median 0.06


def test_the_same_seed_gives_the_same_letters_and_another_seed_others(same):
    same(letters(seed=4), letters(seed=4))
    assert not np.array_equal(paths(letters(seed=4))[0], paths(letters(seed=5))[0])


def test_a_demonstration_does_not_depend_on_how_many_follow():
    np.testing.assert_array_equal(paths(letters(demos=2))[1], paths(letters(demos=9))[1])


def test_without_variation_all_repetitions_are_equal():
    first, *others = letters(variation=0.0).trajectories
    for other in others:
        np.testing.assert_array_equal(other.time_s, first.time_s)
        np.testing.assert_array_equal(other.channels["position_m"], first.channels["position_m"])


def test_hands_slow_down_in_curves():
    trajectory = letters("z", variation=0.0).trajectories[0]
    velocity = estimate_velocity(trajectory.time_s, trajectory.channels["position_m"])
    speed = np.linalg.norm(velocity, axis=1)
    turning = np.abs(np.gradient(np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0])), trajectory.time_s))
    middle = slice(60, -60)
    fast = speed[middle] > np.median(speed[middle])
    assert turning[middle][fast].mean() < 0.5 * turning[middle][~fast].mean()


def test_letters_say_that_they_are_generated():
    assert "generated" in letters().source


def test_settings_that_make_no_sense_are_refused():
    with pytest.raises(UnknownName, match="Did you mean 'sine'"):
        LettersDataset(name="x", letter="sin")
    with pytest.raises(InvalidSetting, match="0 to 3"):
        LettersDataset(name="x", letter="j", variation=4.0)
