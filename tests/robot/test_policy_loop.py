"""Policies on the simulated arm: it does what they say, yields to pushes, and comes back because of them alone."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from geomotion.dynamics.charts import IdentityChart
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.linear import LinearField
from geomotion.errors import InvalidSetting
from geomotion.lie.poses import PoseCoordinates
from geomotion.obstacles.solids import Sphere
from geomotion.robot import panda
from geomotion.robot.chain import panda_chain
from geomotion.robot.disturbances import Displacement, Measured, Push, Sensors
from geomotion.robot.field_policy import FieldPolicy, JointStates, PoseStates, PositionStates
from geomotion.robot.film import Film
from geomotion.robot.policy_loop import PolicyLoop
from geomotion.robot.resolved_rate import TipVelocity

RATE_PER_S = 1.5
HOME = panda_chain("grasp_target").pose(panda.HOME_RAD)
GOAL_M = HOME[0] + [0.05, 0.15, -0.1]


class Towards(ChartedField):
    """ẋ = RATE_PER_S (goal - x)."""

    def __init__(self, goal: np.ndarray) -> None:
        linear = LinearField(len(goal), 1.0, RATE_PER_S).double()
        with torch.no_grad():
            linear.symmetric_root.copy_((RATE_PER_S - 1.0) ** 0.5 * torch.eye(len(goal)))
            linear.skew_root.zero_()
        super().__init__(IdentityChart(len(goal)), linear, 1.0)
        self.goal = torch.from_numpy(goal)

    def velocity(self, x, elapsed_s):
        return super().velocity(x - self.goal, elapsed_s)


@pytest.fixture
def to_goal() -> FieldPolicy:
    return FieldPolicy(Towards(GOAL_M), PositionStates(HOME[1]), torch.float64)


def ideal(time_s: np.ndarray) -> np.ndarray:
    return GOAL_M + np.exp(-RATE_PER_S * time_s)[:, None] * (HOME[0] - GOAL_M)


@pytest.mark.parametrize("rate_hz", [30.0, 60.0])
def test_undisturbed_the_tip_follows_the_field(scene, to_goal, rate_hz):
    run = PolicyLoop(scene, to_goal, rate_hz).run(panda.HOME_RAD, 0.5)
    tracking = run.tracking
    np.testing.assert_allclose(tracking.position_m, ideal(tracking.time_s), atol=6e-3)  # it starts at rest
    np.testing.assert_allclose(tracking.position_m[-1], ideal(tracking.time_s)[-1], atol=3e-3)
    turned = (
        Rotation.from_quat(tracking.orientation_wxyz[-1], scalar_first=True)
        * Rotation.from_quat(HOME[1], scalar_first=True).inv()
    )
    assert turned.magnitude() < 1e-3
    assert len(run.thinking_s) == len(run.is_cut_short) == 0.5 * rate_hz
    assert tracking.position_error_m.max() < 1e-3


def test_a_pushed_arm_yields_by_force_over_damping_and_decays_back_at_the_rate_of_the_field(scene, to_goal):
    push = Push(0.3, 0.25, np.array([0.0, 0.0, 20.0]))
    run = PolicyLoop(scene, to_goal, damping_n_s_per_m=100.0, disturbances=[push]).run(panda.HOME_RAD, 1.2)
    time_s = run.tracking.time_s
    aside_m = (run.tracking.position_m - ideal(time_s))[:, 2]
    released, later = np.searchsorted(time_s, [0.6, 1.1])
    steady_m = 20.0 / 100.0 / RATE_PER_S
    assert aside_m[released] == pytest.approx(steady_m * (1 - np.exp(-0.25 * RATE_PER_S)), rel=0.15)
    assert aside_m[later] / aside_m[released] == pytest.approx(np.exp(-0.5 * RATE_PER_S), rel=0.05)
    lifted_nm = run.torque_nm[int(0.4 * 240)] - run.torque_nm[int(0.25 * 240)]
    assert lifted_nm[1] == pytest.approx(20.0 * np.linalg.norm(HOME[0][:2]), rel=0.3)  # about the shoulder


def test_a_displaced_arm_is_elsewhere_at_once_and_as_oriented(scene, to_goal):
    moved = Displacement(0.2, np.array([0.0, -0.05, 0.0]))
    run = PolicyLoop(scene, to_goal, disturbances=[moved]).run(panda.HOME_RAD, 0.4)
    at = int(np.searchsorted(run.tracking.time_s, 0.2 + 1 / 240))
    aside_m = run.tracking.position_m - ideal(run.tracking.time_s)
    np.testing.assert_allclose(aside_m[at] - aside_m[at - 2], moved.offset_m, atol=3e-3)
    assert run.speed_m_per_s.max() < 0.5  # a displacement is no speed


def test_poses_are_led_to_a_goal_pose(scene):
    coordinates = PoseCoordinates(torch.from_numpy(HOME[1]), 0.3)
    turn = Rotation.from_euler("zx", [0.4, 0.2]) * Rotation.from_quat(HOME[1], scalar_first=True)
    goal = coordinates.to_vector(torch.from_numpy(GOAL_M), torch.from_numpy(turn.as_quat(scalar_first=True))).numpy()
    policy = FieldPolicy(Towards(goal), PoseStates(coordinates, HOME[1]), torch.float64)
    run = PolicyLoop(scene, policy).run(panda.HOME_RAD, 1.2)
    reached = np.array([*run.tracking.position_m[-1], *run.tracking.orientation_wxyz[-1]])
    left = Rotation.from_quat(reached[3:], scalar_first=True) * turn.inv()
    assert left.magnitude() == pytest.approx(np.exp(-1.2 * RATE_PER_S) * 0.45, abs=6e-3)
    np.testing.assert_allclose(reached[:3], ideal(np.array([1.2]))[0], atol=4e-3)


def test_states_do_not_jump_where_the_sign_of_a_measured_quaternion_does():
    coordinates = PoseCoordinates(torch.from_numpy(HOME[1]), 0.3, "S3")
    states = PoseStates(coordinates, HOME[1])
    first, second = (states.state(Measured(HOME[0], sign * HOME[1], panda.HOME_RAD)) for sign in (1, -1))
    np.testing.assert_allclose(first, second, atol=1e-12)


def test_joints_are_led_to_a_goal_configuration_and_pushes_act_on_them_too(scene):
    goal = panda.HOME_RAD + np.array([0.2, 0.1, 0.0, 0.1, 0.0, -0.1, 0.3])
    policy = FieldPolicy(Towards(goal), JointStates(), torch.float64)
    push = Push(0.2, 0.2, np.array([0.0, 15.0, 0.0]))
    alone, pushed = (
        PolicyLoop(scene, policy, disturbances=one).run(panda.HOME_RAD, 0.6).tracking for one in ([], [push])
    )
    expected = goal + np.exp(-RATE_PER_S * alone.time_s)[:, None] * (panda.HOME_RAD - goal)
    np.testing.assert_allclose(alone.joints_rad[-1], expected[-1], atol=8e-3)
    assert (pushed.position_m - alone.position_m)[96, 1] == pytest.approx(0.15 * 0.2, rel=0.3)


def test_latency_and_noise_reach_the_policy_alone(scene):
    seen = []

    def stand(measured, time_s):
        seen.append(measured.position_m)
        return TipVelocity(np.array([0.1, 0.0, 0.0]), np.zeros(3))

    run = PolicyLoop(scene, stand, sensors=Sensors(late_periods=3)).run(panda.HOME_RAD, 0.5)
    np.testing.assert_array_equal(seen[:4], np.tile(seen[0], (4, 1)))
    np.testing.assert_allclose(run.tracking.position_m[-1, 0] - seen[-1][0], 0.1 * 4 / 60, atol=1e-3)


def test_moving_obstacles_and_pushes_are_seen_and_filmed(scene, to_goal):
    scene.add_obstacle("ball", Sphere(torch.from_numpy(HOME[0] + [0.0, 0.0, 0.4]), 0.04))
    film = Film(fps=5.0)
    loop = PolicyLoop(
        scene,
        to_goal,
        disturbances=[Push(0.1, 0.1, np.array([0.0, 10.0, 0.0]))],
        motions={"ball": lambda time_s: np.array([0.0, 0.0, -0.5 * time_s])},
        film=film,
    )
    run = loop.run(panda.HOME_RAD, 0.6)
    assert len(film.frames) == 4
    assert run.tracking.smallest_clearance_m["panda_hand"] < 0.1


def test_impossible_settings_are_refused(scene, to_goal):
    with pytest.raises(InvalidSetting, match=r"replay\.control_hz.*divides 240 Hz"):
        PolicyLoop(scene, to_goal, 100.0).run(panda.HOME_RAD, 1.0)
    with pytest.raises(InvalidSetting, match=r"replay\.duration_s.*one period"):
        PolicyLoop(scene, to_goal).run(panda.HOME_RAD, 0.001)
