"""Balls around an arm contain it: its collision shapes by sampling, and what PyBullet measures of it."""

import numpy as np
import pytest
import torch
from scipy.spatial import ConvexHull
from scipy.spatial.distance import cdist

from geomotion import arms
from geomotion.config import PandaArm, PlanarArm
from geomotion.errors import InvalidSetting, MissingData
from geomotion.obstacles.solids import Sphere
from geomotion.robot.arm import BARE_RADIUS_M, SIMULATOR_MARGIN_M, Arm
from geomotion.robot.body import BodyPoints
from geomotion.robot.cover import cover_hull
from geomotion.robot.quiet import quiet
from geomotion.robot.scene import ArmScene

from .arms import some_joints, write_crooked


def in_shapes(arm: Arm, count: int) -> BodyPoints:
    """Random points of the hulls' surfaces and insides, and their corners, as points of the arm."""
    random, frames, found = np.random.default_rng(0), [], []
    for shape in arm.shapes:
        corners = shape.corners_m()
        triangles = corners[ConvexHull(corners).simplices]
        of_surface = (
            random.dirichlet(np.ones(3), (count, 1)) @ triangles[random.integers(len(triangles), size=count)]
        )[:, 0]
        inside = random.dirichlet(np.full(len(corners), 0.05), count) @ corners
        found.append(np.concatenate([corners, of_surface, inside]))
        frames.append(np.full(len(found[-1]), shape.frame))
    offsets = np.concatenate(found)
    return BodyPoints(np.concatenate(frames), offsets, np.zeros(len(offsets)))


def test_every_point_of_every_link_is_in_a_ball_that_moves_with_it(arm):
    balls, samples = arm.cover(), in_shapes(arm, 500)
    for q in some_joints(arm, 2):
        apart = cdist(arm.chain.points(q, samples), arm.chain.points(q, balls)) - balls.radius_m
        apart[samples.frame[:, None] != balls.frame] = np.inf
        assert apart.min(axis=1).max() <= -SIMULATOR_MARGIN_M + 1e-9


def test_balls_are_few_and_none_reaches_far(arm):
    balls = arm.cover()
    assert len(balls) <= 45
    frames = [shape.frame for shape in arm.shapes]
    for shape in arm.shapes:
        if frames.count(shape.frame) == 1:
            own, faces = balls.frame == shape.frame, ConvexHull(shape.corners_m()).equations
            depth = -(balls.offset_m[own] @ faces[:, :3].T + faces[:, 3]).max(axis=1)
            assert (balls.radius_m[own] - depth).max() < 0.04


def test_fewer_balls_reach_farther():
    cube = np.array([(x, y, z) for x in (0, 0.3) for y in (0, 0.1) for z in (0, 0.1)])
    counts = []
    for excess_m in (0.05, 0.03, 0.02):
        centres, radii = cover_hull(cube, excess_m)
        counts.append(len(radii))
        beyond = np.maximum(centres + radii[:, None] - cube.max(axis=0), cube.min(axis=0) - centres + radii[:, None])
        assert beyond.max() < 1.4 * excess_m
    assert counts[0] < counts[1] < counts[2]


def test_a_thin_rod_across_all_axes_is_covered_along_its_length():
    sides = 0.01 * np.array([(1, -1, 0), (-1, 1, 0), (1, 1, -2), (-1, -1, 2)])
    rod = np.concatenate([sides, sides + 0.6])
    centres, radii = cover_hull(rod, 0.03)
    along = rod[0] + np.linspace(0, 1, 500)[:, None] * (rod[4] - rod[0])
    assert (cdist(along, centres) <= radii).any(axis=1).all()
    assert len(radii) < 25 and radii.max() < 0.06


def test_a_body_as_round_as_a_ball_needs_one():
    directions = np.random.default_rng(0).normal(size=(300, 3))
    sphere = 0.05 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    centres, radii = cover_hull(sphere, 0.02)
    assert len(radii) == 1 and radii[0] < 0.07
    assert (np.linalg.norm(sphere - centres, axis=1) <= radii).all()


def test_the_balls_are_never_farther_than_what_the_simulator_measures():
    arm, random = arms.build(PandaArm()), np.random.default_rng(3)
    balls, looseness = arm.cover(), []
    with ArmScene(arm) as scene:
        scene.add_obstacle("ball", Sphere(torch.zeros(3), 0.03))
        for q in some_joints(arm, 150):
            scene.set_joints(q)
            centre = random.uniform((-0.6, -0.6, -0.2), (0.6, 0.6, 1.1))
            scene.move_obstacle("ball", centre)
            measured = min(scene.clearances(1.0).values())
            centres = arm.chain.points(q, balls)
            found = (np.linalg.norm(centres - centre, axis=1) - balls.radius_m).min() - 0.03
            assert found <= max(measured, -0.01) + 1e-5  # how deep PyBullet says one body is in another is no distance
            looseness.append(measured - found)
    assert 0 < np.mean(looseness) < 0.02


def test_shapes_of_all_kinds_are_what_the_simulator_makes_of_them(tmp_path):
    import pybullet
    from pybullet_utils.bullet_client import BulletClient

    case, random = write_crooked(tmp_path), np.random.default_rng(4)
    arm = case.arm()
    balls, found, measured = arm.cover(), [], []
    with quiet():
        client = BulletClient(pybullet.DIRECT)
        body = client.loadURDF(str(case.path), useFixedBase=True)
    ball = client.createMultiBody(0, client.createCollisionShape(client.GEOM_SPHERE, radius=0.03))
    index = {client.getJointInfo(body, joint)[1].decode(): joint for joint in range(client.getNumJoints(body))}
    client.resetJointState(body, index["slide"], 0.03)
    at_base = client.getLinkState(body, index["mount"], computeForwardKinematics=1)[4:6]
    for q in some_joints(arm, 100):
        for name, angle in zip(arm.joint_names, q, strict=True):
            client.resetJointState(body, index[name], float(angle))
        centre = random.uniform(-0.6, 0.6, 3)
        client.resetBasePositionAndOrientation(ball, *client.multiplyTransforms(*at_base, centre, (0, 0, 0, 1)))
        measured.append(min(contact[8] for contact in client.getClosestPoints(body, ball, 5.0)))
        found.append((np.linalg.norm(arm.chain.points(q, balls) - centre, axis=1) - balls.radius_m).min() - 0.03)
    client.disconnect()
    assert (np.array(found) <= np.maximum(measured, -0.01) + 1e-5).all()
    assert min(measured) < 0.01 < max(measured)


def test_open_fingers_are_covered_and_move_with_the_last_joint(tmp_path):
    arm = write_crooked(tmp_path).arm()
    finger = next(shape for shape in arm.shapes if shape.link == "finger")
    assert finger.frame == 2
    end = arm.chain.tip @ np.array([0, 0.03, 0, 1])
    np.testing.assert_allclose(finger.corners_m().mean(axis=0), end[:3], atol=1e-12)
    open_m = [s.placement[:3, 3] for s in arms.build(PandaArm()).shapes if s.link.endswith("finger")]
    assert np.linalg.norm(open_m[0] - open_m[1]) == pytest.approx(0.08)


def test_links_without_shapes_get_balls_along_the_way_to_the_next_joint(tmp_path):
    arm = write_crooked(tmp_path).arm()
    balls = arm.cover()
    bare = balls.offset_m[balls.frame == 1]  # link two
    np.testing.assert_allclose(bare[[0, -1]], [[0, 0, 0], [0.2, 0.1, 0]])
    assert np.linalg.norm(np.diff(bare, axis=0), axis=1).max() <= BARE_RADIUS_M
    assert (balls.radius_m[balls.frame == 1] == BARE_RADIUS_M).all()


def test_the_same_cover_is_not_computed_twice():
    arm = arms.build(PlanarArm())
    assert arm.cover() is arm.cover() and arms.build(PlanarArm()) is arm


def test_meshes_must_be_there_and_readable(tmp_path):
    case = write_crooked(tmp_path)
    text = case.path.read_text(encoding="utf-8")
    case.path.write_text(text.replace('<sphere radius="0.07"/>', '<mesh filename="package://crooked/one.stl"/>'))
    arm = case.arm()  # kinematics need no meshes
    with pytest.raises(MissingData, match=r"mesh 'package://crooked/one\.stl' of link 'one' not found"):
        arm.cover()
    (tmp_path / "one.stl").write_text("no mesh")
    with pytest.raises(InvalidSetting, match=r"one\.stl is not valid: expected a mesh"):
        arm.cover()
    with pytest.raises(InvalidSetting, match="excess_m"):
        arm.cover(0.0)
