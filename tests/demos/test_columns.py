import pytest

from geomotion.demos.columns import Column, column_names, joint_names, parse, sorted_axes
from geomotion.demos.demonstrations import CHANNEL_UNITS, UNIT_AXES


@pytest.mark.parametrize("channel", CHANNEL_UNITS)
@pytest.mark.parametrize("width", [1, 2, 3, 4, 12])
def test_names_that_are_written_are_understood_when_read(channel, width):
    width = len(UNIT_AXES.get(channel, range(width)))
    names = column_names(channel, width)
    columns = [parse(name) for name in names]
    assert len(set(names)) == width
    assert {column.channel for column in columns} == {channel}
    axes = [column.axis for column in columns]
    assert sorted_axes(axes) == axes
    assert {column.unit for column in columns} <= {"m", None}


@pytest.mark.parametrize(
    "name", ["", "X", "x_", "x_km", "pos_x", "orientation_r", "joint__rad_s", "velocity_x", "time"]
)
def test_other_names_are_not(name):
    assert parse(name) is None


@pytest.mark.parametrize(
    ("name", "axis", "unit"),
    [
        ("panda_joint1", "panda_joint1", None),
        ("panda_joint1_rad", "panda_joint1", None),
        ("shoulder_pan_joint_position_deg", "shoulder_pan_joint", "deg"),
        ("joint_a1", "joint_a1", None),
        ("joint_3_deg", "3", "deg"),
        ("q12", "12", None),
    ],
)
def test_joints_are_called_as_their_urdf_does(name, axis, unit):
    assert parse(name) == Column("joints_rad", axis, unit)


def test_numbers_are_no_names_of_joints():
    assert joint_names(["10", "2"]) == ()
    assert joint_names(["b_joint", "a_joint"]) == ("b_joint", "a_joint")


def test_a_joint_may_have_any_name():
    assert parse("joint_left_elbow_rad") == Column("joints_rad", "left_elbow", None)
    assert parse("joint_left_elbow_rad_per_s") == Column("joint_velocity_rad_per_s", "left_elbow", None)
