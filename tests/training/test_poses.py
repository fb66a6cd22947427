"""Poses as states: their place and size, and what q and -q come to."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from geomotion.scores.paths import PosePath
from geomotion.training.poses import PoseSpace, both_signs
from geomotion.training.states import StateSpace

POINTS = 40


def path(offset_m: float = 0.0, angle_rad: float = 0.0) -> PosePath:
    """An arc beside others, turning on the way."""
    done = np.linspace(0, 1, POINTS)
    position = np.stack([done, np.sin(3 * done) + offset_m, np.full(POINTS, 0.5)], axis=1)
    turns = Rotation.from_rotvec(np.stack([0 * done, 0 * done, done + angle_rad], axis=1))
    return PosePath(position, turns.as_quat(scalar_first=True))


PATHS = [path(-0.1, -0.2), path(), path(0.1, 0.2), path(3.0, 1.0)]


def test_place_and_size_are_the_mean_and_the_root_mean_square_distance():
    paths = [PosePath(np.array([[1.0, 0, 0], [3, 0, 0]]), PATHS[0].orientation[:2]) for _ in range(3)]
    space = PoseSpace.of(paths)
    assert isinstance(space, StateSpace)
    assert (space.centre_m, space.scale_m, space.orientation_dim) == ((2.0, 0.0, 0.0), 1.0, 4)
    assert space.position_dim == 3
    scaled = np.concatenate([PoseSpace.of(PATHS).scaled(one) for one in PATHS])
    np.testing.assert_allclose(scaled[:, :3].mean(axis=0), 0, atol=1e-12)
    assert np.square(scaled[:, :3]).sum(axis=1).mean() == pytest.approx(1)
    np.testing.assert_array_equal(scaled[:POINTS, 3:], PATHS[0].orientation)


def test_what_a_network_means_are_the_poses_that_it_was_shown():
    space = PoseSpace.of(PATHS)
    again = space.path(space.scaled(PATHS[2]))
    np.testing.assert_allclose(again.vectors, PATHS[2].vectors, atol=1e-14)
    assert PoseSpace(**space.document()) == space


def test_poses_are_apart_by_position_and_orientation_whatever_the_sign():
    space, one = PoseSpace.of(PATHS), PATHS[1][7:8]
    found = space.separation(PATHS[3], one)
    in_m = np.linalg.norm(PATHS[3].position_m - one.position_m, axis=1) / space.scale_m
    chords = np.linalg.norm(PATHS[3].orientation - one.orientation, axis=1)
    np.testing.assert_allclose(found, np.hypot(in_m, chords))
    other = PosePath(one.position_m, -one.orientation)
    np.testing.assert_array_equal(space.separation(PATHS[3], other), found)
    assert space.separation(PATHS[1], other).argmin() == 7 and space.separation(PATHS[1], other).min() < 1e-7


def test_any_pose_is_allowed_and_demonstrated_ones_are_supported():
    space = PoseSpace.of(PATHS)
    assert space.allows(PATHS[0]).shape == (POINTS,) and space.allows(PATHS[0]).all()
    for apart in space.support(PATHS).distances(PATHS[2]):
        assert apart.max() < 1e-7


@pytest.mark.parametrize("position_dim", [2, 3])
def test_both_signs_are_the_poses_and_then_the_poses_with_the_other_sign(position_dim):
    poses, progress = torch.randn(11, position_dim + 4), torch.rand(11)
    doubled, twice = both_signs(poses, progress, position_dim)
    assert len(doubled) == len(twice) == 22
    assert torch.equal(doubled[:11], poses) and torch.equal(twice[:11], progress) and torch.equal(twice[11:], progress)
    assert torch.equal(doubled[11:, :position_dim], poses[:, :position_dim])
    assert torch.equal(doubled[11:, position_dim:], -poses[:, position_dim:])
