import pytest

from geomotion.demos.columns import Column, column_names, parse, sorted_axes
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


def test_a_joint_may_have_any_name():
    assert parse("joint_left_elbow_rad") == Column("joints_rad", "left_elbow", None)
    assert parse("joint_left_elbow_rad_per_s") == Column("joint_velocity_rad_per_s", "left_elbow", None)
