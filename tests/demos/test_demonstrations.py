import numpy as np
import pytest

from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.errors import DatasetError, ShapeMismatch, UnknownName


def line(time_s=(0.0, 1.0, 2.0), width=2, label=""):
    time_s = np.array(time_s)
    return Trajectory(time_s, {"position_m": np.outer(time_s, np.ones(width))}, label)


def broken(channel, row, value):
    trajectory = line()
    values = {"position_m": trajectory.channels["position_m"].copy()}
    width = 3 if channel == "direction_xyz" else 4
    values[channel] = values.get(channel, np.tile(np.eye(width)[0], (3, 1)))
    values[channel][row] = value
    return Trajectory(trajectory.time_s, values)


@pytest.mark.parametrize(
    ("trajectories", "words"),
    [
        ((), "holds no demonstration"),
        ((line((0.0,)),), r"demonstration 0 has 1 point"),
        ((line(), line((0.0, 1.0, 1.0), label="b")), r"demonstration 1 \(b\), row 2: time 1 s repeats 1 s"),
        ((line((0.0, 2.0, 1.0)),), r"demonstration 0, row 2: time 1 s goes back from 2 s"),
        ((line((0.0, 1.0, np.nan)),), r"row 2: time is nan"),
        ((line(), line(width=3)), r"demonstration 1 has channels .*expected .*as in demonstration 0"),
        ((broken("position_m", 1, np.nan),), r"demonstration 0, row 1: position_m is .*finite"),
        ((broken("position_m", 2, np.inf),), r"demonstration 0, row 2: position_m is .*finite"),
        ((broken("orientation_wxyz", 1, 0.1),), r"demonstration 0, row 1: quaternion of norm 0.2; expected 1"),
        ((broken("direction_xyz", 2, 0.1),), r"demonstration 0, row 2: direction of norm 0\.173.*; expected 1"),
        ((Trajectory(np.arange(3.0), {"direction_xyz": np.eye(3)[:, :2]}),), r"direction with 2 axes; expected 3"),
        ((Trajectory(np.arange(3.0), {"orientation_wxyz": np.eye(3)}),), r"quaternion with 3 axes; expected 4"),
        ((Trajectory(np.arange(3.0), {"position_m": np.zeros((4, 2))}),), r"position_m has 4 rows, time has 3"),
    ],
)
def test_a_broken_rule_is_named_with_its_place(trajectories, words):
    with pytest.raises(DatasetError, match=words):
        Demonstrations("mine", tuple(trajectories), "R2")


def test_selecting_keeps_order_and_provenance(circles):
    chosen = circles.select([2, 0])
    assert [trajectory.label for trajectory in chosen.trajectories] == ["quarter 60", "quarter 40"]
    assert chosen.steps == circles.steps


def test_selecting_a_demonstration_that_does_not_exist_is_refused(circles):
    with pytest.raises(ShapeMismatch, match=r"numbers 0 to 3, found \[7\]"):
        circles.select([1, 7])


def test_state_and_velocity_put_channels_side_by_side(poses):
    state = poses[0].state(["position_m", "joints_rad"])
    np.testing.assert_array_equal(state[:, :3], poses[0].channels["position_m"])
    np.testing.assert_array_equal(state[:, 3:], poses[0].channels["joints_rad"])


@pytest.mark.parametrize("ask", [lambda t: t.state(["positions_m"]), lambda t: t.velocity(["position_m"])])
def test_a_missing_channel_is_an_error_that_lists_those_there_are(poses, ask):
    with pytest.raises(UnknownName, match="position_m"):
        ask(poses[0])
