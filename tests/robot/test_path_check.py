"""A path is measured by PyBullet: links to obstacles, links to each other, joints to their limits."""

from itertools import pairwise

import numpy as np
import pytest
import torch

from geomotion.arms import PLANAR_URDF
from geomotion.errors import ShapeMismatch
from geomotion.obstacles.solids import Sphere
from geomotion.robot import panda
from geomotion.robot.arm import read_arm
from geomotion.robot.path_check import TRAVEL_M, check_path
from geomotion.robot.scene import ArmScene

from .conftest import arc

FOLDED_RAD = np.array([0.0, 0.0, 0.0, -3.0, 0.0, 0.2, 0.0])  # the hand in the shoulder


def ball(centre_m, radius_m: float = 0.05) -> Sphere:
    return Sphere(torch.tensor(centre_m, dtype=torch.float64), radius_m)


@pytest.fixture
def planar():
    with ArmScene(read_arm(PLANAR_URDF, "base", "tip")) as scene:
        yield scene


def test_distances_are_the_smallest_of_a_dense_query_of_the_simulator(scene):
    path = arc()[::10]
    scene.add_obstacle("ball", ball([0.35, 0.25, 0.45]))
    found = check_path(scene, path, up_to_m=0.3)
    measured = {one.bodies: one for one in found.clearances}
    smallest: dict[tuple[str, str], float] = {}
    for q in np.concatenate([np.linspace(a, b, 200) for a, b in pairwise(path)]):
        scene.set_joints(q)
        for contact in scene.client.getClosestPoints(scene.simulated.body, scene.obstacles["ball"].pieces[0], 0.3):
            link = next(name for name, index in scene.simulated.link_index.items() if index == contact[3])
            smallest[link, "ball"] = min(contact[8], smallest.get((link, "ball"), np.inf))
    assert set(measured) == set(smallest)
    for bodies, distance_m in smallest.items():
        assert abs(measured[bodies].distance_m - distance_m) <= TRAVEL_M / 2
    nearest = found.clearances[0]
    assert nearest.distance_m == min(one.distance_m for one in found.clearances)
    scene.set_joints(path[nearest.row])
    assert scene.clearances(0.5)[nearest.bodies[0]] == pytest.approx(nearest.distance_m, abs=0.05)


def test_no_link_moves_farther_between_two_looks_than_is_said(planar):
    path = np.array([[0.0, 0.0], [0.5, -1.0], [0.5, -1.0]])
    found = check_path(planar, path)
    corner_m = np.hypot(0.55, 0.03)  # of the forearm, stretched
    way_m = 0.5 * corner_m + 1.0 * np.hypot(0.25, 0.03)
    assert way_m / TRAVEL_M <= found.looks - 2 <= 1.1 * way_m / TRAVEL_M  # last row, and the one that repeats another


def test_the_place_of_an_obstacle_on_the_way_between_two_rows_is_found(planar):
    planar.add_obstacle("ball", ball([0.0, 0.5, 0.0], 0.03))
    found = check_path(planar, np.array([[0.0, 0.0], [np.pi, 0.0]]))
    assert found.clearances[0].bodies == ("forearm", "ball")
    assert found.clearances[0].distance_m < 0


def test_the_panda_at_home_is_clear_of_itself_and_folded_it_is_not(scene):
    home, folded = (check_path(scene, q[None]) for q in (panda.HOME_RAD, FOLDED_RAD))
    assert 0.01 < home.self_clearances[0].distance_m < 0.1
    assert folded.self_clearances[0].distance_m < -0.01
    assert {"panda_hand", "panda_link1"} == set(folded.self_clearances[0].bodies)
    assert not home.clearances and home.looks == 1


def test_neighbours_and_what_is_fixed_together_are_no_pairs(scene):
    pairs = set(scene.self_clearances(5.0))
    assert ("panda_link0", "panda_link7") in pairs
    held_together = {"panda_link7", "panda_hand", "panda_leftfinger", "panda_rightfinger"}
    assert not any(set(pair) <= held_together for pair in pairs)
    assert not any({f"panda_link{n}", f"panda_link{n + 1}"} == set(pair) for pair in pairs for n in range(7))


def test_the_joint_that_comes_nearest_to_a_limit_is_named_with_its_row(planar):
    margin = check_path(planar, np.array([[0.0, 0.0], [1.0, -2.75], [1.2, -2.0]])).limit
    assert (margin.joint, margin.row) == ("elbow", 1)
    assert margin.margin_rad == pytest.approx(0.05)
    assert check_path(planar, np.array([[0.0, 2.9]])).limit.margin_rad == pytest.approx(-0.1)


def test_everything_is_written_as_json_types(planar):
    document = check_path(planar, np.array([[0.0, 0.0], [0.1, 0.0]])).as_dict()
    assert document["self_clearance"] is None and document["clearances"] == [] and document["obstacles"] == []
    assert document["limit"] == {"joint": "elbow", "margin_rad": 2.8, "row": 0}


@pytest.mark.parametrize("shape", [(0, 2), (3, 7)])
def test_paths_of_other_arms_are_refused(planar, shape):
    with pytest.raises(ShapeMismatch, match="path of joint positions"):
        check_path(planar, np.zeros(shape))
