"""Plans on a manifold with known geometry: what is found, what it keeps away from, and why there is none."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from geomotion.errors import ShapeMismatch
from geomotion.manifolds.curves import curve_energy
from geomotion.obstacles.motion import ConstantVelocity, MovingBody
from geomotion.obstacles.solids import Box, Solid, Sphere
from geomotion.planning.obstruction import Constraint, Tool
from geomotion.planning.plan import PlanStatus
from geomotion.planning.planner import Planner, energy
from geomotion.scores.paths import PosePath, orientation_angles

CLEARANCE_M = 0.01
HARD = Constraint(CLEARANCE_M)
BOTTLE = Tool(np.array([[0.0, 0, 0], [0.03, 0, 0.05]]), np.array([0.02, 0.015]))


def tensor(*values: float) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float64)


def body(solid: Solid, name: str) -> MovingBody:
    return MovingBody.at_its_velocity(name, solid)


def sphere_at(pose: PosePath, radius: float, name: str = "ball") -> MovingBody:
    return body(Sphere(torch.from_numpy(pose.position_m[0]), radius), name)


def wall(inner: float, outer: float, name: str = "wall") -> MovingBody:
    """Across half of the strip, at the middle of the way, between two distances from the axis [m]."""
    centre, sides = tensor(0.0, (inner + outer) / 2, 0.05), [0.03, outer - inner, 0.3]
    return body(Box(centre, sides, 0.01), name)


def in_small_steps(poses: PosePath, pieces: int = 20) -> PosePath:
    return poses.resampled((len(poses) - 1) * pieces + 1)


def true_clearance(poses: PosePath, bodies: list[MovingBody], tool: Tool, time_s: float = 0.0) -> float:
    """By the bodies' own distance, at closely spaced poses [m]."""
    points = tool.points(in_small_steps(poses))
    apart = [
        body.body.signed_distance(torch.from_numpy(points - body.motion.offset(time_s))).numpy() - tool.radii_m
        for body in bodies
    ]
    return float(np.min(apart))


def assert_meets(path: PosePath, start: PosePath, goal: PosePath) -> None:
    np.testing.assert_allclose(path.position_m[[0, -1]], [start.position_m[0], goal.position_m[0]], atol=1e-12)
    for end, wanted in ((path[:1], start), (path[-1:], goal)):
        assert orientation_angles(end.orientation, wanted.orientation).item() < 1e-7


# ---------------------------------------------------------------- without obstacles
def test_the_free_way_follows_the_middle_of_the_strip(planner, pose_on_strip):
    start, goal = pose_on_strip(0.0), pose_on_strip(1.0)
    found = planner()
    plan = found.plan(found.query(start, goal))
    assert plan.found and plan.status is PlanStatus.found and plan.reason == "found"
    assert_meets(plan.path.states, start, goal)
    assert np.abs(plan.codes[:, 1]).max() < 0.02
    assert (np.diff(plan.path.progress) > -1e-9).all()
    exact = np.sqrt((np.pi * 0.5) ** 2 + 0.1**2) / 0.5, np.pi / 2
    assert plan.scores.length == pytest.approx(np.hypot(*exact), rel=0.02)
    assert plan.scores.length <= 1.05 * plan.scores.graph_length
    assert plan.scores.clearance_m == np.inf
    assert plan.scores.apart_m < 0.02 and plan.scores.apart_rad < 0.1
    assert plan.scores.energy == pytest.approx(energy(found.manifold, plan.codes))
    assert len(plan.codes) == len(plan.path.states) == found.settings.samples


@pytest.mark.parametrize(("start_c", "goal_c"), [(0.02, -0.02), (0.08, -0.09)])
def test_starts_and_goals_beside_the_demonstrated_ones_are_met_exactly(planner, pose_on_strip, start_c, goal_c):
    start, goal = pose_on_strip(0.01, start_c), pose_on_strip(0.98, goal_c)
    lifted = PosePath(start.position_m + np.array([0.0, 0, 0.01]), start.orientation)
    found = planner()
    plan = found.plan(found.query(lifted, goal))
    assert plan.found
    assert_meets(plan.path.states, lifted, goal)
    assert plan.scores.start_residual_m >= 0.009


def test_the_sign_of_a_quaternion_makes_no_difference(planner, pose_on_strip):
    start, goal = pose_on_strip(0.0, 0.05), pose_on_strip(1.0)
    other = PosePath(goal.position_m, -goal.orientation)
    found = planner()
    plan, flipped = (found.plan(found.query(start, one)) for one in (goal, other))
    np.testing.assert_array_equal(plan.path.states.orientation, flipped.path.states.orientation)


def test_known_latent_points_are_taken_as_they_are(planner, pose_on_strip):
    found = planner()
    codes = np.array([[0.2, 0.08]]), np.array([[0.8, -0.08]])
    plan = found.plan(found.query(*(found.state_at(code[0]) for code in codes), codes))
    grid = found.surface.grid
    np.testing.assert_array_equal(grid.nearest(plan.codes[[0, -1]]), grid.nearest(np.concatenate(codes)))
    assert_meets(plan.path.states, pose_on_strip(0.2, 0.08), pose_on_strip(0.8, -0.08))
    with pytest.raises(ShapeMismatch, match="2 coordinates, found 3"):
        found.state_at(np.zeros(3))


def test_the_way_back_is_the_way_there(planner, pose_on_strip):
    found, ends = planner(), (pose_on_strip(0.0, 0.06), pose_on_strip(1.0, -0.06))
    there, back = found.plan(found.query(*ends)), found.plan(found.query(*ends[::-1]))
    assert back.found and back.scores.graph_length == pytest.approx(there.scores.graph_length)
    assert_meets(back.path.states, *ends[::-1])


def test_start_and_goal_in_one_place_are_a_path_of_one_place(planner, pose_on_strip):
    found = planner()
    plan = found.plan(found.query(pose_on_strip(0.5), pose_on_strip(0.5)))
    assert plan.found and plan.scores.length == 0
    np.testing.assert_allclose(plan.path.states.position_m, np.tile(pose_on_strip(0.5).position_m, (200, 1)))


@pytest.mark.parametrize("steps", [5, 40])
def test_refinement_never_raises_the_energy(planner, pose_on_strip, steps):
    ends = pose_on_strip(0.0, 0.07), pose_on_strip(1.0, -0.09)
    one, other = planner(constraint=HARD), planner(constraint=HARD, refine_steps=steps)

    def energy_of(planner: Planner, bodies: list[MovingBody]) -> float:
        query = planner.query(*ends)
        codes = torch.from_numpy(planner.fit(query, planner.search(query, bodies, 0.0)).codes)
        return float(curve_energy(planner.manifold.embedding(codes), planner.manifold.conformal(codes)))

    assert energy_of(other, []) < energy_of(one, [])
    for s in np.linspace(0.2, 0.8, 7):  # where the refined spline would touch an obstacle, the plain one is taken
        bodies = [sphere_at(pose_on_strip(s, 0.01), 0.06)]
        assert energy_of(other, bodies) <= energy_of(one, bodies)


# ---------------------------------------------------------------- obstacles
@pytest.mark.parametrize("tool", [Tool(), BOTTLE], ids=["point", "bottle"])
def test_hard_obstacles_are_kept_clear_of_or_named(planner, pose_on_strip, tool):
    found = planner(shape=tool, constraint=HARD)
    query = found.query(pose_on_strip(0.0), pose_on_strip(1.0, 0.02))
    generator, kept, refused = np.random.default_rng(0), 0, []
    for _ in range(100):
        bodies = []
        for number in range(int(generator.integers(1, 4))):
            near = pose_on_strip(generator.uniform(0, 1), generator.uniform(-0.12, 0.12))
            bodies.append(sphere_at(near, generator.uniform(0.01, 0.1), f"ball {number}"))
        plan = found.plan(query, bodies)
        if plan.found:
            kept += 1
            clearance = true_clearance(plan.path.states, bodies, tool)
            assert clearance >= CLEARANCE_M
            assert plan.scores.clearance_m <= clearance + 1e-9
            nearest = found.surface.grid.nearest(plan.codes)
            assert found.graph.is_free(nearest).all()
            assert plan.scores.length <= 1.05 * plan.scores.graph_length
        else:
            refused.append(plan.status)
            assert plan.path is None and plan.scores is None and len(plan.codes) == 0
            assert plan.blocking and all(name in plan.reason for name in plan.blocking)
            assert set(plan.blocking) <= {one.name for one in bodies}
    assert kept >= 20
    assert (
        {PlanStatus.blocked} <= set(refused) <= {PlanStatus.blocked, PlanStatus.start_covered, PlanStatus.goal_covered}
    )


def test_where_a_stiff_spline_cuts_corners_the_way_is_led_farther_around(planner, pose_on_strip):
    found = planner(points_per_axis=101, shape=BOTTLE, constraint=HARD, control_points=5)
    query = found.query(pose_on_strip(0.0), pose_on_strip(1.0, 0.02))
    generator, cut = np.random.default_rng(0), 0
    for _ in range(60):
        bodies = []
        for number in range(generator.integers(1, 4)):
            near = pose_on_strip(generator.uniform(0.1, 0.9), generator.uniform(-0.12, 0.12))
            bodies.append(sphere_at(near, float(generator.uniform(0.01, 0.07)), f"ball {number}"))
        first = found.fit(query, found.search(query, bodies, 0.0))
        cut += true_clearance(first.path.states, bodies, BOTTLE) < CLEARANCE_M
        plan = found.plan(query, bodies)
        assert plan.found and true_clearance(plan.path.states, bodies, BOTTLE) >= CLEARANCE_M
    assert cut > 0


@pytest.mark.parametrize("samples", [10, 40, 400])
def test_the_stated_clearance_holds_between_the_samples_of_a_path(planner, pose_on_strip, samples):
    found = planner(samples=samples, constraint=HARD, shape=BOTTLE)
    obstacle = sphere_at(pose_on_strip(0.5, 0.09), 0.05)
    plan = found.plan(found.query(pose_on_strip(0.0), pose_on_strip(1.0)), [obstacle])
    assert plan.found
    clearance = true_clearance(plan.path.states, [obstacle], BOTTLE)
    assert plan.scores.clearance_m <= clearance + 1e-9
    assert plan.scores.clearance_m >= clearance - 0.002


def test_an_obstacle_on_the_way_is_passed_and_one_aside_changes_nothing(planner, pose_on_strip):
    found = planner(constraint=HARD)
    query = found.query(pose_on_strip(0.0), pose_on_strip(1.0))
    free = found.plan(query)
    aside = found.plan(query, [sphere_at(pose_on_strip(0.5, -0.4), 0.1)])
    np.testing.assert_array_equal(aside.codes, free.codes)
    passed = found.plan(query, [sphere_at(pose_on_strip(0.5, 0.02), 0.04)])
    assert passed.found and np.abs(passed.codes[:, 1]).max() > 0.02
    again = found.plan(query)
    np.testing.assert_array_equal(again.codes, free.codes)


def test_a_soft_constraint_finds_a_way_and_says_how_clear_it_is(planner, pose_on_strip):
    ends, obstacle = (pose_on_strip(0.0), pose_on_strip(1.0)), sphere_at(pose_on_strip(0.5, 0.01), 0.04)
    clearances = []
    for gain in (0.0, 100.0):
        found = planner(constraint=Constraint(CLEARANCE_M, False, gain))
        plan = found.plan(found.query(*ends), [obstacle])
        assert plan.found
        assert plan.scores.clearance_m <= true_clearance(plan.path.states, [obstacle], Tool()) + 1e-9
        clearances.append(plan.scores.clearance_m)
    assert clearances[0] < 0 < clearances[1]
    thick = wall(0.3, 0.7)
    through = found.plan(found.query(*ends), [thick])
    assert through.found and through.scores.clearance_m < 0


def test_a_moving_obstacle_counts_where_it_is_and_where_it_gets_to(planner, pose_on_strip):
    centre = torch.from_numpy(pose_on_strip(0.5, -0.3).position_m[0])
    towards = pose_on_strip(0.5, 0.0).position_m[0] - centre.numpy()
    moving = MovingBody("cup", Sphere(centre, 0.03), ConstantVelocity(towards))
    found = planner(constraint=HARD)
    query = found.query(pose_on_strip(0.0), pose_on_strip(1.0))
    for time_s in (0.0, 0.9, 1.0):
        plan = found.plan(query, [moving], time_s)
        assert plan.found and true_clearance(plan.path.states, [moving], Tool(), time_s) >= CLEARANCE_M
    ahead = planner(constraint=replace(HARD, horizon_s=1.0))
    plan = ahead.plan(ahead.query(pose_on_strip(0.0), pose_on_strip(1.0)), [moving], 0.0)
    assert plan.found
    for time_s in np.linspace(0, 1, 30):
        assert true_clearance(plan.path.states, [moving], Tool(), time_s) >= CLEARANCE_M


# ---------------------------------------------------------------- several queries on one graph
def test_queries_made_before_are_planned_as_if_they_were_made_last(planner, pose_on_strip):
    shifted = PosePath(pose_on_strip(0.0).position_m + 0.015, pose_on_strip(0.0).orientation)
    beside = np.array([[0.3, 0.132]])  # a little farther from the data than other nodes may be
    asked = [
        (pose_on_strip(0.0), pose_on_strip(1.0), (None, None)),
        (pose_on_strip(0.3, 0.132), pose_on_strip(0.9, -0.05), (beside, None)),
        (shifted, pose_on_strip(0.3, 0.132), (None, beside)),
    ]
    bodies = [sphere_at(pose_on_strip(0.5, 0.05), 0.05)]
    found = planner(constraint=HARD, shape=BOTTLE)
    queries = [found.query(*one) for one in asked]
    for query, one in zip(queries, asked, strict=True):
        alone = planner(constraint=HARD, shape=BOTTLE)
        expected = alone.plan(alone.query(*one), bodies)
        plan = found.plan(query, bodies)
        np.testing.assert_array_equal(found.graph.weights, alone.graph.weights)
        edges = found.surface.grid.edges
        usable = query.is_open[edges].all(axis=1)
        np.testing.assert_array_equal(found.graph.travel_m[usable], BOTTLE.travel_m(query.states, edges[usable]))
        assert np.isinf(found.graph.weights[~usable]).all() and (found.graph.travel_m[~usable] == 0).all()
        assert query.longest_travel_m == found.graph.travel_m.max()
        np.testing.assert_array_equal(plan.path.states.position_m, expected.path.states.position_m)


def test_obstacles_of_the_last_plan_do_not_choose_the_next_goal(planner, pose_on_strip):
    ends = pose_on_strip(0.0), pose_on_strip(0.8, 0.05)
    found, fresh = planner(constraint=HARD), planner(constraint=HARD)
    found.search(found.query(*ends), [sphere_at(ends[1], 0.005)], 0.0)
    assert not found.graph.is_free(np.array([fresh.query(*ends).goal]))[0]
    assert found.query(*ends).goal == fresh.query(*ends).goal
    assert found.plan(found.query(*ends)).found


# ---------------------------------------------------------------- answers with a reason
@pytest.mark.parametrize("covered", [0, 1])
def test_a_covered_start_or_goal_is_named(planner, pose_on_strip, covered):
    ends = pose_on_strip(0.0), pose_on_strip(1.0)
    status = (PlanStatus.start_covered, PlanStatus.goal_covered)[covered]
    found = planner(constraint=HARD)
    for radius in (0.03, CLEARANCE_M / 2):
        beside = PosePath(ends[covered].position_m + np.array([0.0, 0, CLEARANCE_M]), ends[covered].orientation)
        bodies = [sphere_at(pose_on_strip(0.5), 0.02, "far"), sphere_at(beside, radius, "mug")]
        plan = found.plan(found.query(*ends), bodies)
        assert plan.status is status and plan.blocking == ("mug",)
        assert plan.reason.startswith(f"{status.value}: mug")


def test_a_blocked_way_names_the_obstacle_that_blocks_it(planner, pose_on_strip):
    found = planner(constraint=HARD)
    query = found.query(pose_on_strip(0.0), pose_on_strip(1.0))
    plan = found.plan(query, [sphere_at(pose_on_strip(0.2, 0.1), 0.03, "cup"), wall(0.3, 0.7)])
    assert plan.status is PlanStatus.blocked and plan.blocking == ("wall",)
    assert "wall;" in plan.reason and "cup" not in plan.reason


def test_obstacles_that_block_together_or_each_by_itself_are_told_apart(planner, pose_on_strip):
    found = planner(constraint=HARD)
    query = found.query(pose_on_strip(0.0), pose_on_strip(1.0))
    halves = [wall(0.3, 0.5, "inner"), wall(0.49, 0.7, "outer")]
    assert all(found.plan(query, [half]).found for half in halves)
    together = found.plan(query, [*halves, sphere_at(pose_on_strip(0.2, 0.1), 0.03, "cup")])
    assert set(together.blocking) == {"inner", "outer"}
    assert "inner, outer together" in together.reason
    second = body(Sphere(torch.from_numpy(pose_on_strip(0.25).position_m[0]), 0.2), "boulder")
    each = found.plan(query, [wall(0.3, 0.7), second])
    assert set(each.blocking) == {"wall", "boulder"}
    assert "wall, boulder, each by itself" in each.reason


def test_a_gap_in_the_demonstrations_is_crossed_only_if_that_is_allowed(planner, pose_on_strip):
    found = planner(without=(0.4, 0.6))
    plan = found.plan(found.query(pose_on_strip(0.0), pose_on_strip(1.0)))
    assert plan.status is PlanStatus.cap_reached and not plan.found and plan.blocking == ()
    assert "30 mm and 17 deg" in plan.reason and "planning.leave_data_m=" in plan.reason
    bold = planner(without=(0.4, 0.6), cap_m=0.3, cap_rad=1.0)
    assert bold.plan(bold.query(pose_on_strip(0.0), pose_on_strip(1.0))).found


@pytest.mark.parametrize("outside", [0, 1])
def test_a_start_or_goal_away_from_all_demonstrations_is_refused(planner, pose_on_strip, outside):
    found, ends = planner(), [pose_on_strip(0.0), pose_on_strip(1.0)]
    status = (PlanStatus.start_outside, PlanStatus.goal_outside)[outside]
    lifted = PosePath(ends[outside].position_m + np.array([0.0, 0, 0.2]), ends[outside].orientation)
    turned = PosePath(ends[outside].position_m, np.array([[0.0, 1, 0, 0]]))
    for pose, said in ((lifted, "200 mm and 0 deg away from it, at most 60 mm and 34 deg"), (turned, "180 deg away")):
        wrong = [pose if end == outside else one for end, one in enumerate(ends)]
        plan = found.plan(found.query(*wrong))
        assert plan.status is status and said in plan.reason


def test_a_way_that_is_too_long_crosses_a_region_without_data(planner, pose_on_strip):
    found = planner(crossing_length=3.0)
    plan = found.plan(found.query(pose_on_strip(0.0), pose_on_strip(1.0)))
    assert plan.status is PlanStatus.crosses and not plan.found
    assert plan.scores.energy > 9 and "stay below 9" in plan.reason
    assert found.plan(found.query(pose_on_strip(0.0), pose_on_strip(0.5))).found


def test_a_plan_is_written_as_plain_json(planner, pose_on_strip):
    found = planner(constraint=HARD)
    query = found.query(pose_on_strip(0.0), pose_on_strip(1.0))
    document = json.loads(json.dumps(found.plan(query).as_dict(), allow_nan=False))
    assert document["status"] == "found" and document["points"] == 200
    assert document["scores"]["clearance_m"] is None and document["scores"]["length"] > 3
    refused = json.loads(json.dumps(found.plan(query, [wall(0.3, 0.7)]).as_dict(), allow_nan=False))
    assert refused["status"] == "blocked" and refused["blocking"] == ["wall"] and refused["scores"] is None
