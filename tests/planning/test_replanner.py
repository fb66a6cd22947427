"""Replanning: the same answers as planning anew, from wherever the robot is."""

import numpy as np
import pytest
import torch

from geomotion.obstacles.motion import MovingBody, Waypoints
from geomotion.obstacles.solids import Box, Sphere
from geomotion.planning.obstruction import Constraint, Tool
from geomotion.planning.replanner import Replanner
from geomotion.scores.paths import PosePath

HARD = Constraint(0.01)
TOOL = Tool(np.array([[0.0, 0, 0], [0.03, 0, 0.05]]), np.array([0.02, 0.015]))
TIMES_S = np.linspace(0, 1, 12)


@pytest.fixture
def ball_across(pose_on_strip) -> MovingBody:
    """From beside the strip, over it, and back."""
    way = np.array([pose_on_strip(0.5, c).position_m[0] for c in (-0.25, 0.08, -0.25)])
    return MovingBody(
        "ball", Sphere(torch.from_numpy(way[0]), 0.04), Waypoints(np.array([0.0, 0.5, 1.0]), way - way[0])
    )


def test_replanning_gives_the_plan_that_a_fresh_planner_makes(planner, pose_on_strip, ball_across):
    ends = pose_on_strip(0.0, 0.02), pose_on_strip(1.0)
    replanner = Replanner(planner(constraint=HARD, shape=TOOL), *ends)
    lengths = []
    for time_s in TIMES_S:
        curve = replanner.replan([ball_across], time_s)
        fresh = planner(constraint=HARD, shape=TOOL)
        plan = fresh.plan(fresh.query(*ends), [ball_across], time_s)
        assert plan.found
        np.testing.assert_allclose(curve.graph_length, plan.scores.graph_length, rtol=1e-12)
        np.testing.assert_allclose(curve.path.states.position_m, plan.path.states.position_m, atol=1e-9)
        lengths.append(curve.graph_length)
    assert max(lengths) > 1.05 * min(lengths)
    assert lengths[0] == pytest.approx(lengths[-1])


def test_every_replanned_path_keeps_the_clearance(planner, pose_on_strip, ball_across):
    replanner = Replanner(planner(constraint=HARD, shape=TOOL), pose_on_strip(0.0), pose_on_strip(1.0, -0.05))
    for time_s in TIMES_S:
        poses = replanner.replan([ball_across], time_s).path.states.resampled(4000)
        points = TOOL.points(poses)
        apart = np.linalg.norm(points - ball_across.centre_m(time_s), axis=2) - 0.04 - TOOL.radii_m
        assert apart.min() >= HARD.clearance_m


def test_a_path_goes_on_from_where_the_robot_is(planner, pose_on_strip, ball_across):
    replanner = Replanner(planner(constraint=HARD), pose_on_strip(0.0), pose_on_strip(1.0))
    curve = replanner.replan([ball_across], 0.0)
    for time_s, place in ((0.2, 40), (0.4, 90), (0.6, 60)):
        poses = curve.path.states
        node, here = replanner.node_at(curve.codes[place]), poses[place : place + 1]
        curve = replanner.replan([ball_across], time_s, node, here)
        np.testing.assert_allclose(curve.path.states.position_m[0], here.position_m[0], atol=1e-12)
        np.testing.assert_allclose(curve.path.states.position_m[-1], pose_on_strip(1.0).position_m[0], atol=1e-12)
        onward = replanner.planner.ends.onward(replanner.query, node)
        exact = replanner.planner.search(onward, [ball_across], time_s)
        assert curve.graph_length == pytest.approx(exact.cost, rel=1e-12)


def test_without_a_pose_a_path_begins_at_its_node(planner, pose_on_strip):
    replanner = Replanner(planner(), pose_on_strip(0.0, 0.01), pose_on_strip(1.0))
    node = replanner.node_at(np.array([0.4, 0.0]))
    curve = replanner.replan([], 0.0, node)
    np.testing.assert_allclose(curve.path.states.position_m[0], replanner.query.states.position_m[node], atol=1e-12)


def test_a_quaternion_of_the_other_sign_is_the_same_pose(planner, pose_on_strip):
    replanner = Replanner(planner(), pose_on_strip(0.0), pose_on_strip(1.0))
    node, here = replanner.node_at(np.array([0.4, 0.0])), pose_on_strip(0.4)
    curves = [
        replanner.replan([], 0.0, node, PosePath(here.position_m, sign * here.orientation)) for sign in (1.0, -1.0)
    ]
    np.testing.assert_allclose(*(curve.path.states.orientation for curve in curves))


def test_a_blocked_way_is_no_path_and_opens_again(planner, pose_on_strip):
    replanner = Replanner(planner(constraint=HARD), pose_on_strip(0.0), pose_on_strip(1.0))
    free = replanner.replan([], 0.0)
    wall = Box(torch.tensor([0.0, 0.5, 0.05], dtype=torch.float64), [0.03, 0.4, 0.3], 0.01)
    for _ in range(2):
        assert replanner.replan([MovingBody.at_its_velocity("wall", wall)], 0.0) is None
    again = replanner.replan([], 0.0)
    np.testing.assert_array_equal(again.codes, free.codes)
