from dataclasses import replace

import numpy as np
import pytest

from geomotion.config import DatasetConfig
from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.demos.selection import split, state_channels
from geomotion.errors import InvalidSetting, UnknownName


def some(count):
    line = Trajectory(np.arange(3.0), {"position_m": np.zeros((3, 2))})
    return Demonstrations("some", (line,) * count, "R2")


@pytest.mark.parametrize(
    ("count", "train", "test", "expected"),
    [
        (7, None, None, ((0, 1, 2, 3, 4), (5, 6))),
        (4, None, None, ((0, 1), (2, 3))),
        (3, None, None, ((0, 1, 2), ())),
        (1, None, None, ((0,), ())),
        (5, [3, 1], None, ((3, 1), (0, 2, 4))),
        (5, [0, 1], [4], ((0, 1), (4,))),
        (5, [0, 1], [], ((0, 1), ())),
        (5, None, [4], ((0, 1, 2), (4,))),
    ],
)
def test_demonstrations_are_split_as_asked_and_otherwise_the_last_two_are_held_out(count, train, test, expected):
    assert split(DatasetConfig(name="some", train_demos=train, test_demos=test), some(count)) == expected


@pytest.mark.parametrize(("count", "expected"), [(9, (6, 3)), (6, (3, 3)), (5, (5, 0))])
def test_as_many_are_held_out_as_the_dataset_says_where_as_many_remain(count, expected):
    train, test = split(DatasetConfig(name="some", held_out=3), some(count))
    assert (len(train), len(test)) == expected


@pytest.mark.parametrize(
    ("train", "test", "words"),
    [
        ([0, 5], None, r"train_demos=\[0, 5\] .* different numbers from 0 to 4"),
        ([-1], None, "train_demos"),
        ([1, 1], None, "train_demos"),
        ([], None, "train_demos.*at least one"),
        ([0], [5], "test_demos"),
        ([0, 1], [1, 2], r"test_demos=\[1, 2\] .* also has \[1\]"),
        ([0, 1, 2, 3, 4, 5], None, "train_demos"),
    ],
)
def test_a_split_that_cannot_be_is_refused(train, test, words):
    with pytest.raises(InvalidSetting, match=words):
        split(DatasetConfig(name="some", train_demos=train, test_demos=test), some(5))


def test_without_a_choice_positions_are_learned_and_joints_where_there_are_none(poses):
    assert state_channels(DatasetConfig(name="x"), poses) == ("position_m",)
    joints = [replace(one, channels={"joints_rad": one.channels["joints_rad"]}) for one in poses.trajectories]
    assert state_channels(DatasetConfig(name="x"), replace(poses, trajectories=tuple(joints))) == ("joints_rad",)


def test_state_channels_must_exist_and_have_velocities(poses):
    state_channels(DatasetConfig(name="x", state_channels=["position_m", "joints_rad"]), poses)
    with pytest.raises(UnknownName, match="Did you mean 'position_m'"):
        state_channels(DatasetConfig(name="x", state_channels=["positions"]), poses)
    with pytest.raises(InvalidSetting, match="channels with a velocity"):
        state_channels(DatasetConfig(name="x", state_channels=["orientation_wxyz"]), poses)
    with pytest.raises(InvalidSetting, match="some of"):
        state_channels(DatasetConfig(name="x", state_channels=[]), poses)
