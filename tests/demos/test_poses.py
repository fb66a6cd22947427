"""Demonstrations as paths of poses."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from geomotion.config import JCDataset
from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.demos.generators import jc
from geomotion.demos.poses import orientation_channel, pose_path, pose_paths
from geomotion.errors import DatasetError


def turning(time_s: np.ndarray) -> Trajectory:
    """A straight motion that turns at constant rate, at given times from 0 to 1."""
    turns = Slerp([0, 1], Rotation.from_rotvec([[0, 0, 0.2], [0, 0, 1.4]]))(time_s)
    position = np.stack([2 * time_s, -time_s, 0 * time_s], axis=1)
    return Trajectory(time_s, {"position_m": position, "orientation_wxyz": turns.as_quat(scalar_first=True)})


def demonstrations(*trajectories: Trajectory) -> Demonstrations:
    return Demonstrations("turning", trajectories, "R3xS3")


def test_poses_are_even_in_time_however_they_were_recorded():
    even, uneven = np.linspace(0, 1, 80), np.linspace(0, 1, 200) ** 2
    expected = turning(np.linspace(0, 1, 30))
    for path in pose_paths(demonstrations(turning(even), turning(uneven)), 30):
        np.testing.assert_allclose(path.position_m, expected.channels["position_m"], atol=1e-12)
        np.testing.assert_allclose(path.orientation, expected.channels["orientation_wxyz"], atol=1e-4)
        np.testing.assert_allclose(np.linalg.norm(path.orientation, axis=1), 1)


def test_flips_of_sign_are_no_turns():
    whole = turning(np.linspace(0, 1, 80) ** 2)
    flips = np.where(np.random.default_rng(0).random(80) < 0.3, -1.0, 1.0)
    flips[0] = 1
    channels = {**whole.channels, "orientation_wxyz": flips[:, None] * whole.channels["orientation_wxyz"]}
    flipped = Trajectory(whole.time_s, channels)
    np.testing.assert_allclose(pose_path(flipped, "orientation_wxyz").orientation, whole.channels["orientation_wxyz"])
    paths = pose_paths(demonstrations(whole, flipped), 50)
    np.testing.assert_allclose(paths[1].orientation, paths[0].orientation)


def test_positions_in_the_plane_with_directions_are_poses_too():
    dataset = jc.generate(JCDataset(demos=2, points=60))
    assert orientation_channel(dataset) == "direction_xyz"
    for path, trajectory in zip(pose_paths(dataset, 60), dataset.trajectories, strict=True):
        assert path.position_m.shape == (60, 2) and path.orientation.shape == (60, 3)
        np.testing.assert_allclose(path.position_m[[0, -1]], trajectory.channels["position_m"][[0, -1]])


@pytest.mark.parametrize(
    "channels",
    [
        {"position_m": np.zeros((5, 3))},
        {"orientation_wxyz": np.tile([1.0, 0, 0, 0], (5, 1))},
        {
            "position_m": np.zeros((5, 3)),
            "orientation_wxyz": np.tile([1.0, 0, 0, 0], (5, 1)),
            "direction_xyz": np.tile([1.0, 0, 0], (5, 1)),
        },
    ],
)
def test_what_are_no_poses_is_refused(channels):
    dataset = demonstrations(Trajectory(np.linspace(0, 1, 5), channels))
    with pytest.raises(DatasetError, match=r"turning: holds .*; a manifold of poses needs position_m and either"):
        pose_paths(dataset, 10)
