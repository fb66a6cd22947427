"""The scene: distances against closed forms, a grasped object, silence."""

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch

from geomotion.errors import InvalidSetting, ShapeMismatch, UnknownName
from geomotion.obstacles.mesh import Mesh
from geomotion.obstacles.point_cloud import PointCloud
from geomotion.obstacles.solids import Box, Ellipsoid, Sphere
from geomotion.robot import panda
from geomotion.robot.grasp import GraspedCylinder
from geomotion.robot.inverse_kinematics import solve_pose
from geomotion.robot.panda_arm import panda_arm
from geomotion.robot.scene import GRASPED, TABLE, ArmScene

CENTRE = torch.tensor([0.45, 0.1, 0.35]).double()
SKEW = torch.tensor([[0, 0.3, 0.5], [-0.3, 0, 0.2], [-0.5, -0.2, 0]]).double()
TURN = torch.linalg.matrix_exp(SKEW)
PIPELINE = Path(__file__).resolve().parents[2] / "pipeline"
AWAY = np.array([0.02, -0.03, 0.1])


def solid(kind: str):
    match kind:
        case "sphere":
            return Sphere(CENTRE, 0.1)
        case "box":
            return Box(CENTRE, [0.1, 0.2, 0.3], 0.03, TURN)
    return Ellipsoid(CENTRE, [0.1, 0.2, 0.06], TURN)


def around(count: int) -> np.ndarray:
    return CENTRE.numpy() + np.random.default_rng(0).normal(scale=0.2, size=(count, 3))


def cloud(count: int) -> PointCloud:
    points = CENTRE + 0.04 * torch.randn(count, 3, generator=torch.Generator().manual_seed(0)).double()
    return PointCloud(points.numpy(), 0.01)


@pytest.mark.parametrize(("kind", "tolerance_m"), [("sphere", 1e-9), ("box", 1e-9), ("ellipsoid", 3e-4)])
def test_the_distance_of_a_point_to_a_solid_is_the_exact_one(kind, tolerance_m, scene):
    body, points = solid(kind), around(200)
    scene.add_obstacle(kind, body, AWAY)
    expected = body.signed_distance(torch.from_numpy(points)).numpy()
    assert expected.min() < 0 < expected.max()
    found = [scene.probe_distance(point + AWAY, kind) for point in points]
    np.testing.assert_allclose(found, expected, atol=tolerance_m)


def test_the_distance_to_a_mesh_is_that_to_its_surface(scene):
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.1)  # 5120 faces: several pieces
    ball.apply_translation(CENTRE.numpy())
    body = Mesh(ball.vertices, ball.faces)
    scene.add_obstacle("ball", body)
    points = around(50)
    expected = np.abs(np.linalg.norm(points - CENTRE.numpy(), axis=1) - 0.1)
    found = [scene.probe_distance(point, "ball") for point in points]
    np.testing.assert_allclose(found, expected, atol=2e-4)  # sagitta of the facets
    claimed = body.signed_distance(torch.from_numpy(points)).numpy()
    assert (claimed <= np.array(found) + 1e-9).all()
    scene.move_obstacle("ball", AWAY)
    assert scene.probe_distance(points[0] + AWAY, "ball") == pytest.approx(found[0], abs=1e-7)


def test_a_cloud_of_5000_points_loads_in_two_seconds_of_computing_and_has_exact_distances(scene):
    balls = cloud(5000)
    begun_s = time.process_time()
    scene.add_obstacle("cloud", balls)
    assert time.process_time() - begun_s < 2
    points = around(50)
    expected = np.linalg.norm(points[:, None] - np.asarray(balls.points), axis=2).min(axis=1) - balls.radius
    found = [scene.probe_distance(point, "cloud") for point in points]
    np.testing.assert_allclose(found, expected, atol=2e-5)


@pytest.mark.parametrize("kind", ["sphere", "box", "ellipsoid", "cloud"])
def test_the_links_nearest_to_an_obstacle_are_seen_and_touching_ones_named(kind, scene):
    tip, _ = scene.end_effector_pose()
    body = cloud(100) if kind == "cloud" else solid(kind)
    scene.add_obstacle("thing", body, tip + np.array([0.35, 0, 0]) - CENTRE.numpy())
    assert scene.touching() == {}
    free = scene.clearances(0.3)
    assert set(free) == set(scene.body_names)
    assert free["panda_link1"] == 0.3
    assert 0 < free["panda_leftfinger"] < 0.3
    scene.move_obstacle("thing", tip - CENTRE.numpy())
    assert {"panda_leftfinger", "panda_rightfinger"} <= set(scene.touching()["thing"])
    assert min(scene.clearances().values()) <= 0


def test_a_larger_sphere_is_nearer_by_the_difference_of_radii(scene):
    tip, _ = scene.end_effector_pose()
    for name, radius in (("small", 0.03), ("large", 0.07)):
        scene.add_obstacle(name, Sphere(torch.from_numpy(tip - [0, 0.1, 0.2]), radius))
    small, large = (scene.clearances_from(name, 0.5) for name in ("small", "large"))
    assert set(small) == set(scene.body_names)
    for link, distance in small.items():
        assert distance - large[link] == pytest.approx(0.04, abs=1e-6)


def test_a_grasped_cylinder_goes_where_the_hand_goes(scene):
    scene.attach(GraspedCylinder(radius_m=0.035, length_m=0.25))
    assert scene.body_names[-1] == GRASPED
    scene.add_obstacle("ball", Sphere(torch.zeros(3).double(), 0.02))
    for joint in (0.0, 0.5):
        scene.set_joints(panda.HOME_RAD + joint)
        tip, (w, x, y, z) = scene.end_effector_pose()
        across = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)])  # the hand's x
        scene.move_obstacle("ball", tip + 0.2 * across)  # beyond the cylinder's end, at 0.125
        assert scene.clearances()[GRASPED] == pytest.approx(0.2 - 0.125 - 0.02, abs=2e-3)
    with pytest.raises(InvalidSetting, match="one object"):
        scene.attach(GraspedCylinder(0.01, 0.1))


def test_a_table_that_is_touched_is_named_but_is_no_obstacle(scene):
    _, orientation = scene.end_effector_pose()
    down = solve_pose(np.array([0.4, 0.0, 0.0]), orientation, panda.HOME_RAD).joints_rad[0]
    scene.set_joints(down)
    assert {"panda_leftfinger", "panda_rightfinger"} <= set(scene.touching()[TABLE])
    assert set(scene.clearances(0.3).values()) == {0.3}
    with ArmScene(panda_arm()) as floating:
        floating.set_joints(down)
        assert floating.touching() == {}


def test_names_and_bodies_that_do_not_fit_are_refused(scene):
    scene.add_obstacle("ball", solid("sphere"))
    with pytest.raises(InvalidSetting, match="no other body"):
        scene.add_obstacle("ball", solid("box"))
    with pytest.raises(InvalidSetting, match="no other body"):
        scene.add_obstacle("table", solid("box"))
    with pytest.raises(UnknownName, match="Did you mean 'ball'"):
        scene.move_obstacle("bal", AWAY)
    with pytest.raises(UnknownName, match="obstacle"):
        scene.clearances_from("duck", 0.1)
    with pytest.raises(UnknownName, match="obstacle"):
        scene.probe_distance(AWAY, "duck")
    with pytest.raises(ShapeMismatch, match="3 dimensions"):
        scene.add_obstacle("flat", Sphere(torch.zeros(2).double(), 0.1))
    with pytest.raises(TypeError, match="no body"):
        scene.add_obstacle("nothing", object())


def test_scenes_do_not_know_of_each_other(scene):
    scene.add_obstacle("ball", solid("sphere"))
    with ArmScene(panda_arm()) as other:
        other.set_joints(panda.HOME_RAD + 0.3)
        assert other.obstacles == {}
    np.testing.assert_allclose(scene.joints()[0], panda.HOME_RAD)


def test_nothing_is_printed_and_what_python_prints_is_kept():
    program = (
        "print('before')\n"
        "import torch\n"
        "from geomotion.robot.panda_arm import panda_arm\n"
        "from geomotion.robot.scene import ArmScene\n"
        "from geomotion.robot.film import Camera\n"
        "from geomotion.obstacles.solids import Ellipsoid\n"
        "with ArmScene(panda_arm(), table=True) as scene:\n"
        "    scene.add_obstacle('egg', Ellipsoid(torch.zeros(3), [0.1, 0.1, 0.2]))\n"
        "    scene.step(); scene.clearances(); Camera().picture(scene)\n"
        "print('after')\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=PIPELINE)
    assert (done.stdout, done.stderr) == ("before\nafter\n", "")
