"""A hand led along poses from configurations that nearly take them."""

import functools

import numpy as np
import pytest

from geomotion import arms
from geomotion.config import PandaArm, PlanarArm
from geomotion.planning.carrying import Offsets, carried_to
from geomotion.robot.arm import Arm
from geomotion.robot.leading import can_lead, lead
from geomotion.scores.paths import PosePath
from geomotion.training.configurations import configurations


@functools.cache
def arm() -> Arm:
    return arms.build(PandaArm())


def some_joints(count: int, seed: int = 0, room_rad: float = 0.4) -> np.ndarray:
    limits = arm().limits
    return np.random.default_rng(seed).uniform(limits.lower_rad + room_rad, limits.upper_rad - room_rad, (count, 7))


def missed(joints_rad: np.ndarray, position_m: np.ndarray, orientation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    here, there = arm().chain.pose(joints_rad), (position_m, orientation)
    return PosePath(*here).residuals(PosePath(*there))


def test_poses_nearby_are_taken_to_a_tenth_of_a_millimetre():
    joints = some_joints(300)
    wanted = arm().chain.pose(joints + 0.1 * np.random.default_rng(1).normal(size=joints.shape).clip(-2, 2))
    found = lead(arm(), joints, *wanted)
    apart_m, apart_rad = missed(found, *wanted)
    assert np.quantile(apart_m, 0.97) < 1e-4 and np.quantile(apart_rad, 0.97) < 1e-3  # the rest is near singularities
    before_m, before_rad = missed(joints, *wanted)
    assert (apart_m + 0.3 * apart_rad <= before_m + 0.3 * before_rad + 1e-6).all()
    assert (arm().limits.margin_rad(found) >= 0).all()


def test_configurations_that_take_the_poses_stay_as_they_are():
    joints = some_joints(20)
    np.testing.assert_allclose(lead(arm(), joints, *arm().chain.pose(joints)), joints, atol=1e-9)


def test_only_arms_with_joints_enough_are_led():
    planar = arms.build(PlanarArm())
    assert can_lead(arm()) and not can_lead(planar)
    path = configurations(np.zeros((2, 2)), planar)
    assert path.led_along(path.hand) is path


class TestCarrying:
    """Repetitions whose joints differ: the hand of a carried one moves as a carried pose."""

    def paths(self):
        share = np.linspace(0, 1, 60)[:, None]
        first = np.array([0.1, -0.3, 0.2, -2.0, 0.1, 1.8, 0.6])
        turned = np.array([0.9, 0.5, -0.4, 0.5, 0.3, -0.3, 0.8])
        path = configurations(first + share * turned + 0.1 * np.sin(np.pi * share), arm())
        ends = path.with_vectors(path.vectors[[0, -1]] + np.array([[0.15] * 7, [-0.1, 0.2, 0.1, 0.15, -0.2, 0.1, 0.1]]))
        return path, ends, share[:, 0]

    def test_ends_are_met_exactly(self):
        path, ends, progress = self.paths()
        carried = carried_to(path, ends, progress)
        np.testing.assert_allclose(carried.vectors[[0, -1]], ends.vectors, atol=1e-12)

    def test_the_hand_is_carried_as_poses_are(self):
        path, ends, progress = self.paths()
        wanted = Offsets.between(path.hand, ends.hand.with_signs_of(path.hand[:: len(path) - 1]), progress)
        poses = wanted.carry(path.hand, progress)
        led_m, led_rad = carried_to(path, ends, progress).hand.residuals(poses)
        spread_m, spread_rad = Offsets.between(path, ends, progress).carry(path, progress).hand.residuals(poses)
        assert led_m.max() < 1e-3 and led_rad.max() < 2e-3
        assert spread_m.max() > 5 * led_m.max() and spread_rad.max() > 5 * led_rad.max()

    @pytest.mark.parametrize("seed", range(3))
    def test_nothing_changes_where_nothing_has_to(self, seed):
        share = np.linspace(0, 1, 20)[:, None]
        begin, end = some_joints(2, seed)
        path = configurations(begin + 0.3 * share * (end - begin), arm())
        np.testing.assert_allclose(
            carried_to(path, path[:: len(path) - 1], share[:, 0]).vectors, path.vectors, atol=1e-8
        )
