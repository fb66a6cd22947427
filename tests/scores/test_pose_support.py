"""Distances of poses from demonstrated ones, against brute force."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.scores.paths import PosePath, orientation_angles
from geomotion.scores.pose_support import PoseSupport, leave_one_out


def poses(count: int, seed: int = 0, coordinates: int = 4) -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(seed)
    orientation = generator.normal(size=(count, coordinates))
    return generator.random((count, 3)), orientation / np.linalg.norm(orientation, axis=1, keepdims=True)


@pytest.mark.parametrize("coordinates", [3, 4])
@pytest.mark.parametrize("count", [5, 300])
def test_distances_are_those_of_brute_force(count, coordinates):
    position_m, orientation = poses(count, coordinates=coordinates)
    asked_m, asked = poses(50, seed=1, coordinates=coordinates)
    found_m, found_rad = PoseSupport(position_m, orientation).distances(PosePath(asked_m, asked))
    apart = cdist(asked_m, position_m)
    np.testing.assert_allclose(found_m, apart.min(axis=1))
    nearest = np.argsort(apart, axis=1)[:, :20]
    angles = np.take_along_axis(orientation_angles(asked, orientation), nearest, axis=1)
    np.testing.assert_allclose(found_rad, angles.min(axis=1), atol=1e-7)


def test_demonstrated_poses_are_at_distance_zero_whatever_the_sign_of_their_quaternions():
    position_m, orientation = poses(100)
    in_m, in_rad = PoseSupport(position_m, orientation).distances(PosePath(position_m, -orientation))
    assert in_m.max() == 0
    assert in_rad.max() < 1e-7


def test_orientations_that_occur_far_away_do_not_count():
    position_m = np.repeat([[0.0, 0, 0], [1.0, 0, 0]], 30, axis=0)
    orientation = np.repeat([[1.0, 0, 0, 0], [0.0, 1, 0, 0]], 30, axis=0)
    elsewhere = PosePath(np.zeros((1, 3)), orientation[-1:])
    _, apart_rad = PoseSupport(position_m, orientation).distances(elsewhere)
    np.testing.assert_allclose(apart_rad, np.pi)


def test_the_share_within_a_radius_grows_with_it_from_none_to_all():
    support = PoseSupport(np.zeros((1, 3)), np.array([[1.0, 0, 0, 0]]))
    asked = np.linspace([0.0, 0, 0], [1.0, 0, 0], 11)
    shares = [support.share_within(asked, radius_m) for radius_m in (0.0, 0.25, 0.55, 1.0)]
    np.testing.assert_allclose(shares, [1 / 11, 3 / 11, 6 / 11, 1])


def test_leave_one_out_names_the_farthest_pose_of_each_demonstration():
    line, identity = np.linspace([0.0, 0, 0], [1.0, 0, 0], 50), np.tile([1.0, 0, 0, 0], (50, 1))
    aside = PosePath(line + np.array([0, 0, 0.1]), identity)
    turned = PosePath(line, np.tile([np.cos(0.15), np.sin(0.15), 0, 0], (50, 1)))
    in_m, in_rad = leave_one_out([PosePath(line, identity), aside, turned])
    np.testing.assert_allclose(in_m, [0, 0.1, 0], atol=1e-12)
    np.testing.assert_allclose(in_rad, [0.0, 0.0, 0.3], atol=1e-7)


def test_what_cannot_be_compared_is_refused():
    position_m, orientation = poses(3)
    with pytest.raises(ShapeMismatch, match="demonstrated poses"):
        PoseSupport(position_m, orientation[:2])
    with pytest.raises(InvalidSetting, match="two or more"):
        leave_one_out([PosePath(position_m, orientation)])
