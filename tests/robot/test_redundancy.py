"""Poses met to rounding while the elbow follows a wanted swivel."""

import numpy as np
import pytest

from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.robot import panda
from geomotion.robot.chain import panda_chain
from geomotion.robot.redundancy import REST_RAD, solve_swivel_path

from .conftest import TASKS

SWIVELS_RAD = (-1.1, 0.5, 1.1)


def line(count=25):
    """Poses along a line in front of the arm, the hand pointing down."""
    x = np.linspace(0.5, 0.65, count)
    return np.stack([x, -0.1 + 0 * x, 0.1 + 0 * x], axis=1), np.tile([0.0, 1.0, 0.0, 0.0], (count, 1))


@pytest.mark.parametrize("swivel", SWIVELS_RAD)
@pytest.mark.parametrize("task", TASKS)
def test_recorded_tasks_are_followed_to_rounding_at_every_swivel(task, swivel, recorded):
    positions, orientations = (values[::8] for values in recorded(task))
    found = solve_swivel_path(positions, orientations, np.full(len(positions), swivel))
    assert found.path.position_error_m.max() < 1e-9 and found.path.orientation_error_rad.max() < 1e-7
    assert found.attained.all() and found.swivel_error_rad.max() < 1e-8
    assert found.path.limit_margin_rad.min() > 0.1


def test_the_elbow_follows_a_changing_swivel_without_jumps():
    positions, orientations = line(60)
    wanted = 0.9 * np.sin(np.linspace(0, 2 * np.pi, 60)) + 0.1
    found = solve_swivel_path(positions, orientations, wanted)
    np.testing.assert_allclose(found.swivel_rad, wanted, atol=1e-8)
    assert found.path.position_error_m.max() < 1e-9
    assert found.path.largest_step_rad < 0.4


def test_a_swivel_that_joint_limits_forbid_costs_the_pose_nothing_and_is_reported():
    positions, orientations = line()
    found = solve_swivel_path(positions, orientations, np.linspace(1.0, 3.0, len(positions)))
    assert found.path.position_error_m.max() < 1e-6 and found.path.orientation_error_rad.max() < 1e-6
    assert found.attained[0] and not found.attained[-1]
    assert found.path.limit_margin_rad.min() >= 0
    assert found.path.limit_margin_rad[-1] == pytest.approx(0, abs=1e-9)  # it went as far as it could
    np.testing.assert_allclose(found.swivel_error_rad[-1], 3.0 - found.swivel_rad[-1])


def test_poses_out_of_reach_are_named():
    positions, orientations = line()
    positions[10:12, 0] += 2.0
    found = solve_swivel_path(positions, orientations, np.full(len(positions), 0.5))
    assert [pose.index for pose in found.path.unreachable] == [10, 11]


def test_the_swivel_of_a_pose_is_free_where_the_pose_is_that_of_rest():
    position, orientation = panda_chain("flange").pose(REST_RAD)
    found = solve_swivel_path(position[None], orientation[None], np.array([0.7]), "flange")
    assert found.attained.all() and found.path.reached.all()
    assert panda.LIMITS.margin_rad(found.path.joints_rad).min() > 0.1


def test_what_is_no_path_is_refused():
    positions, orientations = line(5)
    with pytest.raises(ShapeMismatch, match="one for each pose"):
        solve_swivel_path(positions, orientations, np.zeros(4))
    with pytest.raises(InvalidSetting, match="unit quaternions"):
        solve_swivel_path(positions, 2 * orientations, np.zeros(5))
