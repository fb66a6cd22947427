"""The controller: it arrives at the pace asked for, without jumps, and is not touched by what moves."""

from itertools import pairwise

import numpy as np
import pytest
import torch

from geomotion.obstacles.motion import ConstantVelocity, MovingBody, Waypoints
from geomotion.obstacles.solids import Sphere
from geomotion.planning.controller import BLEND, ControllerSettings, GeodesicController
from geomotion.planning.obstruction import Constraint, Tool
from geomotion.scores.paths import PosePath

PERIOD_S, PACE_M_PER_S, ESCAPE_M_PER_S = 1 / 30, 0.3, 0.4
CONSTRAINT = Constraint(0.01, horizon_s=1.0)
TOOL = Tool(np.array([[0.0, 0, 0], [0.03, 0, 0.02]]), np.array([0.02, 0.015]))
BALL_M = 0.04


@pytest.fixture
def controller(planner, pose_on_strip):
    """Builds one that goes along the whole strip."""

    made, ends = (
        planner(25, constraint=CONSTRAINT, shape=TOOL, samples=50),
        (pose_on_strip(0.0, 0.01), pose_on_strip(1.0)),
    )

    def build(pace=lambda progress: PACE_M_PER_S) -> GeodesicController:
        return GeodesicController(made, *ends, pace, ControllerSettings(PERIOD_S, look_every=3))

    return build


def ball(place_m: np.ndarray, motion) -> MovingBody:
    return MovingBody("ball", Sphere(torch.from_numpy(place_m), BALL_M), motion)


def passing(place_m: np.ndarray, times_s: list[float], offsets_m: list[list[float]]) -> MovingBody:
    return ball(place_m, Waypoints(np.array(times_s), np.array(offsets_m)))


def driven(
    controller: GeodesicController, bodies, end_s: float, begin_s: float = 0.0, stops: bool = False
) -> tuple[PosePath, float]:
    """The poses of all periods, or of those until it arrives, and the smallest distance to any obstacle [m]."""
    poses, apart_m = [controller.state], np.inf
    for step in range(round(begin_s / PERIOD_S), round(end_s / PERIOD_S)):
        poses.append(controller.step(step * PERIOD_S, bodies))
        points_m = TOOL.points(poses[-1])[0]
        for body in bodies:
            offsets = points_m - body.centre_m((step + 1) * PERIOD_S)
            apart_m = min(apart_m, float((np.linalg.norm(offsets, axis=1) - TOOL.radii_m).min()) - BALL_M)
        if stops and controller.arrived:
            break
    parts = [[getattr(one, name)[0] for one in poses] for name in ("position_m", "orientation")]
    return PosePath(*(np.array(part) for part in parts)), apart_m


def test_without_obstacles_it_follows_the_plan_at_the_pace_asked_for(controller, pose_on_strip):
    def pace(progress: float) -> float:
        return 0.2 + 0.3 * progress

    pilot = controller(pace)
    plan = pilot.planner.plan(pilot.query)
    lengths_m, progress = plan.path.states.steps_m(), plan.path.progress
    needed_s = float((lengths_m / [pace((a + b) / 2) for a, b in pairwise(progress)]).sum())
    driven(pilot, [], 0.9 * needed_s)
    assert not pilot.arrived
    poses, _ = driven(pilot, [], 0.15 * needed_s)
    assert pilot.arrived
    assert pilot.waited_s == 0
    np.testing.assert_allclose(poses.position_m[-1], pose_on_strip(1.0).position_m[0], atol=1e-6)
    np.testing.assert_allclose(poses.orientation[-1], pose_on_strip(1.0).orientation[0], atol=1e-6)


def test_no_step_is_longer_than_the_pace_and_what_blends_two_ways(controller, pose_on_strip):
    crossing = ball(pose_on_strip(0.5, -0.3).position_m[0], ConstantVelocity(np.array([0.0, 0.1, 0.0])))
    for bodies in ([], [crossing]):
        poses, _ = driven(controller(), bodies, 8.0)
        fastest_m = PERIOD_S * (ESCAPE_M_PER_S if bodies else PACE_M_PER_S)
        assert poses.steps_m().max() <= fastest_m * (1 + 1 / BLEND) + 1e-6


def test_a_ball_across_the_way_never_touches_it(controller, pose_on_strip):
    aimed = controller()
    path = aimed.planner.plan(aimed.query).path.states
    behind_m = np.concatenate([[0.0], np.cumsum(path.steps_m())])
    arrived = 0
    for seed in range(40):
        draw = np.random.default_rng(seed)
        row = int(draw.uniform(0.3, 0.7) * (len(path) - 1))
        there_s = behind_m[row] / PACE_M_PER_S + draw.uniform(-0.5, 0.5)
        along = path.position_m[row + 1] - path.position_m[row - 1]
        across = np.cross(along, draw.normal(size=3))
        velocity = across / np.linalg.norm(across) * draw.uniform(0.05, 0.15)
        body = ball(path.position_m[row] - velocity * there_s, ConstantVelocity(velocity))
        pilot = controller()
        _, apart_m = driven(pilot, [body], 8.0, stops=True)
        assert apart_m > 0, f"seed {seed}"
        arrived += pilot.arrived
    assert arrived >= 36


def test_it_waits_for_what_blocks_the_way_and_goes_on_when_that_has_gone(controller, pose_on_strip):
    wall = [
        passing(pose_on_strip(0.5, c).position_m[0], [0.0, 6.0, 7.0], [[0.0, 0, 0], [0, 0, 0], [0, 0, 0.8]])
        for c in np.linspace(-0.13, 0.13, 3)
    ]
    pilot = controller()
    poses, apart_m = driven(pilot, wall, 5.9)
    assert not pilot.arrived
    assert pilot.waited_s > 4
    assert poses.steps_m()[-30:].max() == 0
    _, apart_later_m = driven(pilot, wall, 14.0, 5.9, stops=True)
    assert pilot.arrived
    assert min(apart_m, apart_later_m) >= CONSTRAINT.clearance_m


def test_a_covered_goal_is_waited_for_at_a_distance(controller, pose_on_strip):
    body = ball(pose_on_strip(1.0).position_m[0], ConstantVelocity(np.zeros(3)))
    pilot = controller()
    poses, apart_m = driven(pilot, [body], 3.0)
    assert not pilot.arrived
    assert pilot.waited_s == pytest.approx(3.0)
    assert poses.steps_m().max() == 0
    assert apart_m > CONSTRAINT.clearance_m


def test_it_gets_out_of_the_way_of_what_comes_at_it_at_rest(controller, pose_on_strip):
    pilot = controller()
    driven(pilot, [], 7.0)
    assert pilot.arrived
    goal_m = pose_on_strip(1.0).position_m[0]
    comes = passing(goal_m, [0.0, 2.0, 2.5, 5.0], [[-0.3, 0, 0], [0, 0, 0], [0, 0, 0], [-0.4, 0, 0]])
    _, apart_m = driven(pilot, [comes], 2.5)
    assert not pilot.arrived
    assert apart_m > 0
    _, apart_later_m = driven(pilot, [comes], 9.0, 2.5)
    assert pilot.arrived
    assert apart_later_m > 0


def test_time_at_the_goal_is_no_waiting(controller):
    pilot = controller()
    driven(pilot, [], 9.0)
    assert pilot.arrived
    assert pilot.waited_s == 0
