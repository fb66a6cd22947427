"""Joint positions for paths: recorded tasks, random poses, and poses that the arm cannot take."""

import numpy as np
import pytest

from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.robot import panda
from geomotion.robot.chain import panda_chain
from geomotion.robot.inverse_kinematics import solve_path, solve_pose

from .conftest import TASKS


@pytest.mark.parametrize("frame", list(panda.FRAME_LINKS))
@pytest.mark.parametrize("task", TASKS)
def test_every_pose_of_a_recorded_task_is_reached_without_jumps(task, frame, recorded):
    path = solve_path(*recorded(task), frame)
    assert path.reached.all() and path.unreachable == ()
    assert path.position_error_m.max() < 1e-6 and path.orientation_error_rad.max() < 1e-6
    assert path.limit_margin_rad.min() > 0.1
    assert path.largest_step_rad < np.radians(7)


def test_the_simulated_arm_is_where_the_path_says(recorded, scene):
    positions, orientations = recorded("pouring")
    path = solve_path(positions, orientations, "grasp_target")
    for index in (0, 77, 199):
        scene.set_joints(path.joints_rad[index])
        found, turned = scene.end_effector_pose()
        np.testing.assert_allclose(found, positions[index], atol=1e-6)
        assert abs(turned @ orientations[index]) == pytest.approx(1, abs=1e-6)


def test_any_pose_that_the_arm_can_take_is_found():
    chain = panda_chain("grasp_target")
    for q in np.random.default_rng(1).uniform(panda.LIMITS.lower_rad, panda.LIMITS.upper_rad, size=(60, 7)):
        position, quaternion = chain.pose(q)
        path = solve_path(position[None], -quaternion[None])
        assert path.reached.all()
        assert path.limit_margin_rad.min() >= 0


def test_poses_out_of_reach_are_named_with_the_distance_that_remains(recorded):
    positions, orientations = recorded("wineglass")
    positions = positions[:40].copy()
    away = 2.0 * positions[20] / np.linalg.norm(positions[20])
    positions[20:23] = away
    path = solve_path(positions, orientations[:40])
    assert [pose.index for pose in path.unreachable] == [20, 21, 22]
    # from the shoulder, 0.333 m above the base, the Panda spans 0.855 m to the wrist's end, 1.07 m to the fingers
    assert all(0.8 < pose.position_error_m < 1.3 for pose in path.unreachable)
    assert path.reached.sum() == 37
    assert path.limit_margin_rad.min() >= 0


def test_a_path_that_starts_out_of_reach_is_followed_as_soon_as_it_can_be(recorded):
    positions, orientations = recorded("scoop")
    shifted = positions[:30].copy()
    shifted[:3, 0] += 1.0
    path = solve_path(shifted, orientations[:30])
    np.testing.assert_array_equal(np.flatnonzero(~path.reached), [0, 1, 2])


def test_one_pose_is_solved_from_nearby_joint_positions():
    q = panda.HOME_RAD + 0.1
    position, quaternion = panda_chain("flange").pose(q)
    found = solve_pose(position, quaternion, panda.HOME_RAD, "flange")
    assert found.reached.tolist() == [True]
    assert np.abs(found.joints_rad[0] - panda.HOME_RAD).max() < 0.5


def test_what_is_no_path_of_poses_is_refused(recorded):
    positions, orientations = recorded("wineglass")
    with pytest.raises(InvalidSetting, match="unit quaternions"):
        solve_path(positions, 2 * orientations)
    broken = positions.copy()
    broken[4, 1] = np.nan
    with pytest.raises(InvalidSetting, match="pose 4"):
        solve_path(broken, orientations)
    with pytest.raises(ShapeMismatch, match="as many orientations"):
        solve_path(np.zeros((0, 3)), np.zeros((0, 4)))
    with pytest.raises(InvalidSetting, match="NaN"):
        solve_pose(broken[4], orientations[4], panda.HOME_RAD)
