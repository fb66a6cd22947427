import numpy as np
import pytest

from geomotion.config import LasaDataset, LasaPoseDataset
from geomotion.demos.readers import read
from geomotion.demos.readers.lasa_pose import on_sphere
from geomotion.errors import UnknownName


def test_points_on_the_sphere_are_turns_by_twice_the_angle_they_are_seen_under():
    points = np.array([[0.0, 0.0], [0.05, 0.0], [0.0, -0.02]])
    quaternions = on_sphere(points, 0.05)
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1)
    np.testing.assert_allclose(2 * np.arccos(quaternions[:, 0]), [0, np.pi / 2, 2 * np.arctan(0.4)])
    np.testing.assert_allclose(quaternions[:, 1:3] / quaternions[:, :1] * 0.05, points)


def test_both_shapes_are_in_the_poses(lasa_folder):
    poses = read(LasaPoseDataset(name="lasa/pose", root=str(lasa_folder)))
    stacked = read(LasaDataset(name="lasa/stacked_4d", shapes=["Angle", "Sine"], root=str(lasa_folder)))
    assert (len(poses), poses.space) == (7, "R3xS3")
    for pose, planar in zip(poses.trajectories, stacked.trajectories, strict=True):
        np.testing.assert_array_equal(pose.channels["position_m"][:, :2], planar.channels["position_m"][:, :2])
        assert not pose.channels["position_m"][:, 2].any()
        scalar, across = pose.channels["orientation_wxyz"][:, :1], pose.channels["orientation_wxyz"][:, 1:3]
        np.testing.assert_allclose(0.05 * across / scalar, planar.channels["position_m"][:, 2:], atol=1e-12)
        np.testing.assert_allclose(pose.channels["orientation_wxyz"][-1], [1, 0, 0, 0], atol=1e-12)
    assert "projected from the centre of the sphere" in poses.steps[0]


def test_unknown_shapes_are_named():
    with pytest.raises(UnknownName, match="Did you mean 'Sine'"):
        LasaPoseDataset(name="lasa/pose", orientation_shape="Sinee")
