"""Demonstrations as paths of an arm's joints: order, time, and what is refused."""

import logging

import numpy as np
import pytest

from geomotion.config import PreprocessConfig
from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.demos.joints import joint_paths, without_whole_turns
from geomotion.demos.preprocessing import preprocess
from geomotion.errors import DatasetError
from geomotion.robot.panda import JOINTS, LIMITS

MIDDLE_RAD = (LIMITS.lower_rad + LIMITS.upper_rad) / 2


def sweep(joints_rad=None, names=JOINTS, **channels):
    """One demonstration at uneven times that swings every joint about the middle of its range."""
    time_s = np.linspace(0, 1, 30) ** 1.5
    if joints_rad is None:
        joints_rad = MIDDLE_RAD + 0.5 * np.sin(2 * np.pi * time_s)[:, None]
    trajectory = Trajectory(time_s, {"joints_rad": joints_rad, **channels}, "swing")
    return Demonstrations("test/sweep", (trajectory,), "joint", joint_names=names)


def paths(demonstrations, points=50):
    return joint_paths(demonstrations, JOINTS, LIMITS, points)


def test_paths_are_even_in_time():
    (path,) = paths(sweep(), 201)
    expected = MIDDLE_RAD + 0.5 * np.sin(2 * np.pi * np.linspace(0, 1, 201))[:, None]
    np.testing.assert_allclose(path, expected, atol=0.01)


def test_joints_are_found_by_name_and_others_left_out():
    (wanted,) = paths(sweep())
    order = [3, 0, 6, 1, 2, 5, 4]
    shuffled = sweep().trajectories[0].channels["joints_rad"][:, order]
    with_finger = np.column_stack([shuffled[:, :2], np.full(30, 0.04), shuffled[:, 2:]])
    names = [JOINTS[joint] for joint in order]
    names.insert(2, "panda_finger_joint1")
    (found,) = paths(sweep(with_finger, tuple(names)))
    np.testing.assert_array_equal(found, wanted)


def test_joints_without_names_are_taken_in_order_where_there_are_as_many():
    np.testing.assert_array_equal(paths(sweep(names=()))[0], paths(sweep())[0])
    with pytest.raises(DatasetError, match="has 6 joints without names; the arm has panda_joint1"):
        paths(sweep(np.zeros((30, 6)), ()))


def test_names_of_another_arm_are_listed_beside_those_of_this_one():
    names = tuple(f"iiwa_joint_{number}" for number in range(1, 8))
    with pytest.raises(
        DatasetError, match=r"lacks panda_joint1, .* joints iiwa_joint_1, .* the arm has panda_joint1, "
    ):
        paths(sweep(names=names))


def test_recordings_without_joints_are_refused():
    position = Trajectory(np.arange(3.0), {"position_m": np.zeros((3, 3))})
    with pytest.raises(DatasetError, match="holds position_m; joint space needs joints_rad"):
        paths(Demonstrations("x", (position,), "R3"))


def test_names_must_be_as_many_as_joints():
    with pytest.raises(DatasetError, match="holds 7 joints; expected one for each of a, b"):
        sweep(names=("a", "b"))


def test_degrees_are_recognised_and_the_setting_named():
    with pytest.raises(DatasetError, match=r"reach 1\d\d\.?\d*: beyond .* set dataset\.angle_unit=deg"):
        paths(sweep(np.degrees(sweep()[0].channels["joints_rad"])))


def test_a_joint_beyond_its_limit_is_named_with_its_place():
    joints = sweep()[0].channels["joints_rad"].copy()
    joints[12, 3] = 0.2
    with pytest.raises(
        DatasetError, match=r"demonstration 0 \(swing\), row 12: panda_joint4 is 0.2 rad, beyond .* -3.072 to -0.0698"
    ):
        paths(sweep(joints))


def test_single_precision_at_a_limit_is_no_violation():
    joints = np.tile(LIMITS.upper_rad.astype(np.float32).astype(np.float64), (30, 1))
    assert len(paths(sweep(joints))) == 1


def test_numbers_that_are_none_are_refused():
    joints = sweep()[0].channels["joints_rad"].copy()
    joints[4, 2] = np.nan
    with pytest.raises(DatasetError, match="row 4: joints_rad"):
        sweep(joints)


def test_jumps_by_a_whole_turn_are_mended_and_counted(caplog):
    smooth = np.tile(MIDDLE_RAD, (30, 1))
    smooth[:, 5] = np.linspace(2.8, 3.6, 30)
    wrapped = (smooth + np.pi) % (2 * np.pi) - np.pi
    with caplog.at_level(logging.WARNING, logger="geomotion"):
        mended = without_whole_turns(sweep(wrapped))
    assert "mended 1 jumps" in caplog.text and "mended 1 jumps" in mended.steps[-1]
    np.testing.assert_allclose(mended[0].channels["joints_rad"], smooth, atol=1e-12)
    assert without_whole_turns(mended) is mended
    np.testing.assert_allclose(paths(sweep(wrapped))[0], paths(sweep(smooth))[0], atol=1e-12)


def test_velocities_are_estimated_after_jumps_are_mended():
    joints = np.tile(MIDDLE_RAD, (30, 1))
    joints[:, 5] = (np.linspace(2.8, 3.6, 30) + np.pi) % (2 * np.pi) - np.pi
    found = preprocess(sweep(joints), PreprocessConfig())
    assert np.abs(found[0].channels["joint_velocity_rad_per_s"]).max() < 5


def test_angles_in_degrees_are_not_taken_for_wrapped_ones():
    joints = np.tile(np.linspace(-150.0, 150.0, 30)[:, None], (1, 7))
    joints[::2] += 6.0
    assert without_whole_turns(sweep(joints)).steps == ()
