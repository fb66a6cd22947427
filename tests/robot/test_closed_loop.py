"""Control in closed loop: targets are met, limits are kept, moving obstacles are seen."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from geomotion.errors import InvalidSetting
from geomotion.obstacles.solids import Sphere
from geomotion.robot import panda
from geomotion.robot.chain import panda_chain
from geomotion.robot.closed_loop import approach_velocity, closed_loop

CONTROL_HZ = 60.0
HOME = panda_chain("grasp_target").pose(panda.HOME_RAD)


def circle(time_s: float) -> tuple[np.ndarray, np.ndarray]:
    """A circle of 5 cm, begun at rest at home, with a turn about the vertical."""
    angle = np.pi * (1 - np.cos(np.pi * min(time_s / 3, 1)))
    turn = Rotation.from_euler("z", 0.3 * np.sin(angle)) * Rotation.from_quat(HOME[1], scalar_first=True)
    return HOME[0] + 0.05 * np.array([np.cos(angle) - 1, np.sin(angle), 0]), turn.as_quat(scalar_first=True)


@pytest.mark.parametrize("control_hz", [30.0, 60.0, 240.0])
def test_the_arm_is_a_period_later_where_the_controller_wants_it(control_hz, scene):
    seen = []

    def controller(time_s, position_m, orientation_wxyz):
        seen.append(np.linalg.norm(position_m - circle(time_s)[0]))
        return circle(time_s + 1 / control_hz)

    result = closed_loop(scene, controller, panda.HOME_RAD, 3.0, control_hz)
    assert len(seen) == len(result.time_s) == 3 * control_hz
    assert max(seen) < 2e-3
    assert result.unreachable == ()
    assert result.tracking.position_error_m.max() < 1e-3


def test_velocity_and_acceleration_stay_within_limits_even_if_targets_jump(scene):
    goals = [HOME[0], HOME[0] + [0.15, 0.1, -0.1], HOME[0] + [0.0, -0.2, 0.1]]
    result = closed_loop(scene, lambda t, *_: (goals[int(t)], HOME[1]), panda.HOME_RAD, 3.0, CONTROL_HZ)
    commanded = np.vstack([panda.HOME_RAD, result.tracking.commanded_joints_rad])
    velocity = np.diff(commanded, axis=0) * 240
    assert (np.abs(velocity) <= panda.LIMITS.velocity_rad_per_s + 1e-9).all()
    change = np.diff(velocity[::4], axis=0) * CONTROL_HZ
    assert (np.abs(change) <= panda.LIMITS.acceleration_rad_per_s2 * (1 + 1e-9)).all()
    for second in (1, 2, 3):
        at_end = result.tracking.position_m[240 * second - 1]
        np.testing.assert_allclose(at_end, goals[second - 1], atol=2e-3)


def test_a_target_is_approached_without_overshooting():
    goal = np.array([1.0, -0.5, 0.01, -0.0003, 2.0, -1.2, 0.2])
    for period_s in (1 / 240, 1 / 60, 1 / 20):
        joints, velocity = np.zeros(7), np.zeros(7)
        for _ in range(round(2.0 / period_s)):
            velocity = approach_velocity(joints, velocity, goal, goal, period_s, panda.LIMITS)
            joints = joints + period_s * velocity
            assert (np.sign(goal) * (joints - goal) < 1e-12).all()
        np.testing.assert_allclose(joints, goal, atol=1e-9)


def test_poses_out_of_reach_are_reported_and_approached(scene):
    far = HOME[0] + [0.9, 0, 0]
    result = closed_loop(scene, lambda *_: (far, HOME[1]), panda.HOME_RAD, 1.0, CONTROL_HZ)
    assert [pose.index for pose in result.unreachable] == list(range(60))
    assert result.unreachable[0].position_error_m > 0.1
    assert result.tracking.position_m[-1, 0] > HOME[0][0] + 0.2
    np.testing.assert_array_equal(result.target_position_m, np.tile(far, (60, 1)))


def test_a_controller_that_gives_way_is_not_touched_by_a_moving_obstacle(scene):
    scene.add_obstacle("ball", Sphere(torch.from_numpy(HOME[0] - [0, 0.4, 0]), 0.04))

    def comes(time_s: float) -> np.ndarray:
        return np.array([0.0, 0.15 * time_s, 0.0])

    def gives_way(time_s, position_m, orientation_wxyz):
        return HOME[0] + [0, max(0.0, 0.15 * time_s - 0.1), 0], HOME[1]

    stays = closed_loop(scene, lambda *_: HOME, panda.HOME_RAD, 2.5, CONTROL_HZ, motions={"ball": comes})
    assert stays.tracking.contact_steps["ball"]
    moved = closed_loop(scene, gives_way, panda.HOME_RAD, 2.5, CONTROL_HZ, motions={"ball": comes})
    assert moved.tracking.contact_steps == {}


def test_impossible_periods_are_refused(scene):
    for control_hz in (0.0, 100.0, 480.0):
        with pytest.raises(InvalidSetting, match="divides 240 Hz"):
            closed_loop(scene, lambda *_: HOME, panda.HOME_RAD, 1.0, control_hz)
    with pytest.raises(InvalidSetting, match="one period"):
        closed_loop(scene, lambda *_: HOME, panda.HOME_RAD, 0.0)
    with pytest.raises(InvalidSetting, match="unit quaternions"):
        closed_loop(scene, lambda *_: (HOME[0], np.zeros(4)), panda.HOME_RAD, 1.0)
