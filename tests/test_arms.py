"""Arms from settings."""

import numpy as np
import pytest

from geomotion import arms
from geomotion import config as schema
from geomotion.errors import InvalidSetting
from geomotion.robot import panda


def test_the_panda_has_the_limits_of_its_documentation():
    arm = arms.build(schema.PandaArm())
    assert arm.joint_names == panda.JOINTS
    np.testing.assert_array_equal(arm.limits.jerk_rad_per_s3, panda.LIMITS.jerk_rad_per_s3)
    np.testing.assert_array_equal(arm.limits.lower_rad, panda.LIMITS.lower_rad)


def test_part_of_the_panda_has_the_limits_of_its_joints():
    forearm = arms.build(schema.PandaArm(base_link="panda_link3", tip_link="panda_link6"))
    np.testing.assert_array_equal(forearm.limits.jerk_rad_per_s3, panda.LIMITS.jerk_rad_per_s3[3:6])


def test_the_planar_arm_is_in_a_plane_and_as_long_as_its_links():
    arm = arms.build(schema.PlanarArm())
    position_m, _ = arm.chain.pose(np.array([[0.0, 0.0], [np.pi / 2, 0.0], [0.0, np.pi / 2]]))
    np.testing.assert_allclose(position_m, [[0.55, 0, 0], [0, 0.55, 0], [0.3, 0.25, 0]], atol=1e-12)


def test_a_urdf_of_ones_own_is_an_arm_and_says_nothing_of_accelerations():
    settings = schema.UrdfArm(
        urdf=str(arms.PLANAR_URDF), base_link="base", tip_link="tip", acceleration_rad_per_s2=3.0, jerk_rad_per_s3=50.0
    )
    arm = arms.build(settings)
    assert arm.joint_names == ("shoulder", "elbow") and arm is arms.build(settings)
    np.testing.assert_array_equal(arm.limits.acceleration_rad_per_s2, [3.0, 3.0])
    np.testing.assert_array_equal(arm.limits.jerk_rad_per_s3, [50.0, 50.0])


def test_accelerations_are_positive():
    with pytest.raises(InvalidSetting, match=r"arm\.jerk_rad_per_s3=0"):
        schema.UrdfArm(urdf="arm.urdf", base_link="base", tip_link="tip", jerk_rad_per_s3=0.0)
