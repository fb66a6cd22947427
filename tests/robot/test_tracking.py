"""The simulated arm follows recorded tasks, past obstacles and with a bottle in its hand."""

import numpy as np
import pytest
import torch

from geomotion.errors import UnknownName
from geomotion.obstacles.mesh import Mesh
from geomotion.obstacles.solids import Sphere
from geomotion.robot import panda
from geomotion.robot.chain import panda_chain
from geomotion.robot.film import Camera, Film
from geomotion.robot.grasp import GraspedCylinder
from geomotion.robot.inverse_kinematics import solve_path
from geomotion.robot.panda_arm import panda_arm
from geomotion.robot.recording import MAX_CLEARANCE_M
from geomotion.robot.scene import GRASPED, ArmScene
from geomotion.robot.timing import fastest, like_demonstration
from geomotion.robot.tracking import follow

from .conftest import DEMO_S, TASKS, arc

EVEN = np.linspace(0, 1, 100)
BALL_M = 0.04


def ball_at(position: np.ndarray) -> Sphere:
    return Sphere(torch.from_numpy(position), BALL_M)


@pytest.mark.parametrize("task", TASKS)
def test_recorded_tasks_are_followed_within_5_mm_and_1_degree(task, recorded, scene):
    path = solve_path(*recorded(task), "grasp_target")
    tracking = follow(scene, like_demonstration(path.joints_rad, EVEN, DEMO_S, panda.LIMITS))
    assert tracking.position_error_m.max() < 3e-4  # 5 mm are asked for
    assert tracking.orientation_error_rad.max() < np.radians(0.05)
    assert tracking.limit_margin_rad.min() > 0.1
    assert tracking.contact_steps == {}


def test_even_the_fastest_motion_is_followed_also_with_a_bottle(scene):
    scene.attach(GraspedCylinder(radius_m=0.035, length_m=0.25))
    tracking = follow(scene, fastest(arc(), panda.LIMITS))
    assert tracking.position_error_m.max() < 5e-4
    assert tracking.orientation_error_rad.max() < np.radians(1)
    held, _ = scene.client.getBasePositionAndOrientation(scene._grasped.body)
    np.testing.assert_allclose(held, tracking.position_m[-1], atol=1e-3)


def test_errors_are_between_measured_and_commanded_poses_at_equal_time():
    timed = fastest(arc(), panda.LIMITS)
    with ArmScene(panda_arm(tip_link="panda_link8")) as scene:
        tracking = follow(scene, timed)
    np.testing.assert_allclose(tracking.time_s, timed.time_s[1:])
    wanted, _ = panda_chain("flange").pose(timed.joints_rad[1:])
    measured, _ = panda_chain("flange").pose(tracking.joints_rad)
    np.testing.assert_allclose(np.linalg.norm(wanted - measured, axis=1), tracking.position_error_m, atol=1e-6)
    np.testing.assert_allclose(measured, tracking.position_m, atol=1e-6)
    np.testing.assert_array_equal(tracking.commanded_joints_rad, timed.joints_rad[1:])


def test_clearance_beside_an_obstacle_is_positive_and_nothing_touches(scene):
    timed = like_demonstration(arc(), EVEN, 2.0, panda.LIMITS)
    tip, _ = panda_chain("grasp_target").pose(timed.joints_rad[len(timed.joints_rad) // 2])
    scene.add_obstacle("ball", ball_at(tip + np.array([0.12, 0, 0])))
    tracking = follow(scene, timed)
    nearest = tracking.smallest_clearance_m
    assert set(nearest) == set(scene.body_names)
    assert 0 < min(nearest.values()) < MAX_CLEARANCE_M
    assert nearest["panda_link1"] == MAX_CLEARANCE_M
    assert tracking.contact_steps == {}


def test_an_obstacle_that_moves_into_the_arm_is_felt_and_counted(scene):
    timed = like_demonstration(arc(), EVEN, 2.0, panda.LIMITS)
    tip, _ = panda_chain("grasp_target").pose(timed.joints_rad[-1])
    scene.add_obstacle("ball", ball_at(tip))

    def comes_down(time_s: float) -> np.ndarray:
        return np.array([0.0, 0.0, max(0.0, 1.5 - time_s)])

    tracking = follow(scene, timed, motions={"ball": comes_down})
    touched = tracking.contact_steps["ball"]
    assert any(name in touched for name in ("panda_hand", "panda_leftfinger", "panda_rightfinger"))
    assert max(touched.values()) > 10
    first = tracking.clearance_time_s[np.min(list(tracking.clearance_m.values()), axis=0) <= 0.001][0]
    assert first > 0.8
    with pytest.raises(UnknownName, match="Did you mean 'ball'"):
        follow(scene, timed, motions={"bal": comes_down})


def test_the_arm_is_stopped_by_a_mesh_in_its_way_and_each_touching_link_is_counted(scene):
    trimesh = pytest.importorskip("trimesh")
    timed = like_demonstration(arc(), EVEN, 2.0, panda.LIMITS)
    wall = trimesh.creation.box(extents=[0.3, 0.02, 0.5])
    middle, _ = panda_chain("grasp_target").pose(timed.joints_rad[len(timed.joints_rad) // 2])
    wall.apply_translation(middle)
    scene.add_obstacle("wall", Mesh(wall.vertices, wall.faces))
    tracking = follow(scene, timed)
    assert tracking.contact_steps["wall"]
    assert tracking.position_error_m.max() > 0.05


def test_a_grasped_object_has_its_own_clearance(scene):
    scene.attach(GraspedCylinder(radius_m=0.03, length_m=0.2))
    scene.add_obstacle("ball", ball_at(panda_chain("grasp_target").pose(arc()[-1])[0] + [0, 0, -0.16]))
    tracking = follow(scene, like_demonstration(arc(), EVEN, 2.0, panda.LIMITS))
    assert tracking.clearance_m[GRASPED].shape == tracking.clearance_time_s.shape
    assert min(tracking.smallest_clearance_m, key=tracking.smallest_clearance_m.get) == GRASPED


def test_a_film_is_taken_on_the_way(scene):
    film = Film(fps=5.0, speed=4.0, camera=Camera(width=64, height=48))
    follow(scene, like_demonstration(arc(), EVEN, 4.0, panda.LIMITS), film=film)
    assert len(film.frames) == pytest.approx(5 * 4.0 / 4.0, abs=1)
    assert (film.frames[0] != film.frames[-1]).any()
