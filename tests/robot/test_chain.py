"""The arm's kinematics, against PyBullet and against differences; its limits, against its URDF."""

from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.robot import panda
from geomotion.robot.chain import panda_chain

FRAMES = list(panda.FRAME_LINKS)


def joints(count: int) -> np.ndarray:
    return np.random.default_rng(0).uniform(panda.LIMITS.lower_rad, panda.LIMITS.upper_rad, size=(count, 7))


@pytest.mark.parametrize("frame", FRAMES)
def test_poses_are_those_of_the_simulated_arm(frame, scene):
    for q in joints(30):
        scene.set_joints(q)
        position, quaternion = scene.simulated.link_pose(panda.FRAME_LINKS[frame])
        expected, turned = panda_chain(frame).pose(q)
        np.testing.assert_allclose(position, expected, atol=1e-6)
        assert abs(np.roll(quaternion, 1) @ turned) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("frame", FRAMES)
def test_the_jacobian_is_the_derivative_of_the_pose(frame):
    chain, step = panda_chain(frame), 1e-6
    for q in joints(5):
        tip, jacobian = chain.pose_and_jacobian(q)
        for joint, direction in enumerate(step * np.eye(7)):
            ahead, _ = chain.pose_and_jacobian(q + direction)
            behind, _ = chain.pose_and_jacobian(q - direction)
            np.testing.assert_allclose((ahead - behind)[:3, 3] / (2 * step), jacobian[:3, joint], atol=1e-8)
            turn = Rotation.from_matrix(ahead[:3, :3] @ behind[:3, :3].T).as_rotvec()
            np.testing.assert_allclose(turn / (2 * step), jacobian[3:, joint], atol=1e-8)
        np.testing.assert_allclose(tip[:3, 3], chain.pose(q)[0])


def test_batches_give_the_same_as_single_poses():
    q = joints(6).reshape(2, 3, 7)
    positions, quaternions = panda_chain("flange").pose(q)
    assert (positions.shape, quaternions.shape) == ((2, 3, 3), (2, 3, 4))
    np.testing.assert_allclose(positions[1, 2], panda_chain("flange").pose(q[1, 2])[0])
    with pytest.raises(ShapeMismatch, match="joint positions"):
        panda_chain("flange").pose(q[..., :6])


def test_position_and_velocity_limits_are_those_of_the_urdf():
    found = {joint.get("name"): joint for joint in ElementTree.parse(panda.urdf_path()).iter("joint")}
    soft = [found[name].find("safety_controller") for name in panda.JOINTS]
    hard = [found[name].find("limit") for name in panda.JOINTS]
    np.testing.assert_array_equal([float(s.get("soft_lower_limit")) for s in soft], panda.LIMITS.lower_rad)
    np.testing.assert_array_equal([float(s.get("soft_upper_limit")) for s in soft], panda.LIMITS.upper_rad)
    np.testing.assert_array_equal([float(h.get("velocity")) for h in hard], panda.LIMITS.velocity_rad_per_s)


def test_the_margin_is_that_of_the_joint_closest_to_a_limit():
    q = np.stack([panda.LIMITS.lower_rad + 0.5, panda.LIMITS.upper_rad - 0.5])
    q[0, 3], q[1, 5] = panda.LIMITS.lower_rad[3] + 0.1, panda.LIMITS.upper_rad[5] + 0.2
    np.testing.assert_allclose(panda.LIMITS.margin_rad(q), [0.1, -0.2])


def test_scaled_limits_leave_positions_alone():
    half = panda.LIMITS.scaled(0.5)
    np.testing.assert_array_equal(half.lower_rad, panda.LIMITS.lower_rad)
    np.testing.assert_allclose(half.jerk_rad_per_s3, panda.LIMITS.jerk_rad_per_s3 / 2)
    with pytest.raises(InvalidSetting, match="limit_share"):
        panda.LIMITS.scaled(1.5)
