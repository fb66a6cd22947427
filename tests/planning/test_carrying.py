"""Skills carried to other ends."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geomotion.planning.carrying import SHORTEST_PROGRESS, Offsets, blended, meet
from geomotion.scores.configurations import ConfigurationPath
from geomotion.scores.paths import PosePath

PROGRESS = np.linspace(0, 1, 40)


def path(dim: int = 4, count: int = 40, seed: int = 0) -> PosePath:
    generator = np.random.default_rng(seed)
    position = generator.normal(size=(count, 3)).cumsum(axis=0) / 10
    if dim == 4:
        turns = Rotation.from_rotvec(generator.normal(size=(count, 3)).cumsum(axis=0) / 20)
        orientation = turns.as_quat(scalar_first=True, canonical=True)
    else:
        orientation = np.array([0, 0, 1.0]) + generator.normal(size=(count, 3)).cumsum(axis=0) / 20
        orientation /= np.linalg.norm(orientation, axis=1, keepdims=True)
    return PosePath(position, orientation)


def ends(dim: int = 4) -> PosePath:
    return path(dim, count=2, seed=7)


def assert_same(one: PosePath, other: PosePath, atol: float = 1e-12) -> None:
    np.testing.assert_allclose(one.vectors, other.vectors, atol=atol)


@pytest.mark.parametrize("dim", [3, 4])
def test_wanted_ends_are_met_exactly(dim):
    offsets = Offsets.between(path(dim), ends(dim), PROGRESS)
    assert_same(offsets.carry(path(dim), PROGRESS)[:1], ends(dim)[:1])
    assert_same(offsets.carry(path(dim), PROGRESS)[-1:], ends(dim)[-1:])
    assert_same(meet(path(dim), ends(dim))[:1], ends(dim)[:1])
    assert_same(meet(path(dim), ends(dim))[-1:], ends(dim)[-1:])


@pytest.mark.parametrize("places", [(5, 30), (30, 5)])
def test_any_two_poses_can_be_brought_to_the_ends_and_shares_stay_beyond_them(places):
    poses = path()
    offsets = Offsets.between(poses, ends(), PROGRESS, places)
    carried = offsets.carry(poses, PROGRESS)
    for end, place in zip((0, 1), places, strict=True):
        assert_same(carried[place : place + 1], ends()[end : end + 1])
    beyond = offsets.start if places[0] < places[1] else offsets.goal
    np.testing.assert_allclose(carried.position_m[:5] - poses.position_m[:5], np.tile(beyond[:3], (5, 1)))


@pytest.mark.parametrize("dim", [3, 4])
def test_offsets_of_zero_change_nothing(dim):
    poses = path(dim)
    none = np.zeros(3 + dim)
    assert_same(Offsets(none, none).carry(poses, PROGRESS), poses)
    assert_same(Offsets.between(poses, poses, PROGRESS).carry(poses, PROGRESS), poses)
    assert_same(meet(poses, poses), poses)


def test_what_is_carried_is_brought_back_in_position_and_nearly_in_orientation():
    poses = path()
    small = PosePath(ends().position_m, poses[:: len(poses) - 1].orientation)
    offsets = Offsets.between(poses, small, PROGRESS)
    back = offsets.undone(offsets.carry(poses, PROGRESS), PROGRESS)
    assert_same(back, poses)
    turned = Offsets.between(poses, ends(), PROGRESS)
    back = turned.undone(turned.carry(poses, PROGRESS), PROGRESS)
    np.testing.assert_allclose(back.position_m, poses.position_m, atol=1e-12)


def test_offsets_fade_linearly_along_progress():
    still = PosePath(np.zeros((40, 3)), np.tile([1.0, 0, 0, 0], (40, 1)))
    offsets = Offsets(np.array([1.0, 0, 0, 0, 0, 0, 0]), np.array([0, 2.0, 0, 0, 0, 0, 0]))
    carried = offsets.carry(still, PROGRESS)
    np.testing.assert_allclose(carried.position_m, np.stack([1 - PROGRESS, 2 * PROGRESS, 0 * PROGRESS], axis=1))


def test_where_progress_does_not_tell_the_ends_apart_the_path_is_left_to_the_end():
    poses, wanted = path(), ends()
    offsets = Offsets.between(poses, wanted, np.full(40, 0.5))
    assert offsets.goal_progress - offsets.start_progress < SHORTEST_PROGRESS
    assert offsets.carry(poses, PROGRESS) is poses
    met = meet(poses, wanted)
    assert_same(met[:1], wanted[:1])


def test_meeting_spreads_what_is_missing_evenly_over_the_length():
    corner = np.concatenate([np.linspace([0.0, 0, 0], [3, 0, 0], 31), np.linspace([3.0, 0, 0], [3, 1, 0], 50)[1:]])
    poses = PosePath(corner, np.tile([1.0, 0, 0, 0], (80, 1)))
    wanted = PosePath(np.array([[0.0, 0, 0], [3, 1, 4]]), np.tile([1.0, 0, 0, 0], (2, 1)))
    met = meet(poses, wanted)
    np.testing.assert_allclose(met.position_m[30, 2], 3.0)
    np.testing.assert_allclose(met.position_m[:, :2], corner[:, :2])


def test_a_path_that_stays_in_one_place_is_led_from_start_to_goal():
    still = PosePath(np.zeros((5, 3)), np.tile([1.0, 0, 0, 0], (5, 1)))
    wanted = PosePath(np.array([[0.0, 0, 0], [4, 0, 0]]), np.tile([1.0, 0, 0, 0], (2, 1)))
    np.testing.assert_allclose(meet(still, wanted).position_m[:, 0], np.arange(5))


def test_configurations_are_carried_joint_by_joint():
    generator = np.random.default_rng(0)
    joints, wanted = generator.normal(size=(40, 7)).cumsum(axis=0) / 10, generator.normal(size=(2, 7))
    arm = ConfigurationPath(joints, lambda q: (q[:, :3], np.tile([1.0, 0, 0, 0], (len(q), 1))))
    goals = arm.with_vectors(wanted)
    offsets = Offsets.between(arm, goals, PROGRESS)
    carried = offsets.carry(arm, PROGRESS)
    expected = (1 - PROGRESS)[:, None] * (wanted[0] - joints[0]) + PROGRESS[:, None] * (wanted[1] - joints[-1])
    np.testing.assert_allclose(carried.joints_rad, joints + expected)
    np.testing.assert_allclose(offsets.undone(carried, PROGRESS).joints_rad, joints, atol=1e-12)
    np.testing.assert_allclose(meet(arm, goals).joints_rad[[0, -1]], wanted)


def test_vectors_and_poses_are_the_same_but_for_length_one():
    poses = path()
    assert_same(poses.with_vectors(poses.vectors), poses)
    stretched = poses.with_vectors(poses.vectors * np.array([1, 1, 1, 3, 3, 3, 3]))
    assert_same(stretched, poses)
    half = blended(poses, np.zeros(7), np.array([1.0, 0, 0, 0, 0, 0, 0]), np.full(40, 0.5))
    np.testing.assert_allclose(half.position_m - poses.position_m, np.tile([0.5, 0, 0], (40, 1)))
