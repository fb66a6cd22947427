"""What the captions of Ch. 3 say, as numbers: the presets `experiment=thesis/fig_3_…` with less data and training."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from geomotion.demos.poses import pose_paths
from geomotion.planning.plan import PlanStatus
from geomotion.stages import methods, planners
from geomotion.stages.evaluate_geodesics import pairs
from geomotion.stages.scene import moving_bodies

from .presets import Trained, configured, trained

SHORT = [
    "graph.points_per_axis=80",
    "training.steps=900",
    "training.spread_steps=300",
    "training.restarts=0",
    "training.batch_points=256",
]
JC = [*SHORT, "manifold.kernels=300", "dataset.demos=8"]
RECORDED = [*SHORT, "manifold.points=100"]
POURING = [*SHORT, "training.steps=1000", "dataset.demos=12", "dataset.points=80", "manifold.points=80"]


@pytest.fixture(scope="module")
def letters(tmp_path_factory) -> Trained:
    return trained(configured("fig_3_1", *JC), tmp_path_factory.mktemp("letters"))


@pytest.fixture(scope="module")
def wineglass_root(robotasks9_folder) -> str:
    return f"dataset.root={robotasks9_folder}"


@pytest.fixture(scope="module")
def wineglass(tmp_path_factory, wineglass_root) -> Trained:
    return trained(configured("fig_3_7", *RECORDED, wineglass_root), tmp_path_factory.mktemp("wineglass"))


@pytest.fixture(scope="module")
def pouring(tmp_path_factory) -> Trained:
    return trained(configured("fig_3_9", *POURING), tmp_path_factory.mktemp("pouring"))


# ---------------------------------------------------------------- Fig. 3.1, 3.2
def test_both_signs_of_an_orientation_make_two_clusters_that_the_kernels_keep_apart(letters):
    manifold = letters.skilled.manifold
    own = np.concatenate([codes.numpy() for codes in manifold.codes])
    apart = cdist(own, manifold.other_codes)
    steps = max(float(np.linalg.norm(np.diff(codes.numpy(), axis=0), axis=1).max()) for codes in manifold.codes)
    assert apart.min() > 3 * steps
    assert apart.min() > 8 * float(manifold.network.concentration.bandwidth)
    facing = manifold.decode(own).states.orientation * manifold.decode(manifold.other_codes).states.orientation
    assert facing.sum(axis=1).max() < -0.9


def test_variance_is_low_on_the_data_only_and_magnification_is_high_on_their_border(letters):
    manifold, grid = letters.skilled.manifold, letters.skilled.surface.grid
    log_std, log_magnification = (values.ravel() for values in letters.skilled.maps)
    apart = cdist(grid.nodes, manifold.all_codes).min(axis=1) / float(manifold.network.precision.bandwidth)
    on_data, on_border = apart < 1, (apart > 3) & (apart < 5)
    assert np.median(log_std[apart > 5]) - np.median(log_std[on_data]) > 3
    assert np.median(log_magnification[on_border]) - np.median(log_magnification[on_data]) > 4


def test_riemannian_geodesic_stays_on_the_data_and_the_straight_line_does_not(letters):
    planned = letters.planned(configured("fig_3_1", *JC))
    (plan,) = planned.plans
    assert plan.found and plan.scores.line_energy > 100 * plan.scores.energy
    line = np.linspace(plan.codes[0], plan.codes[-1], 200)
    apart_m, _ = planned.planner.support.distances(planned.planner.manifold.decode(line).states)
    assert apart_m.max() > 3 * plan.scores.apart_m


# ---------------------------------------------------------------- Fig. 3.3
def test_a_fine_graph_equals_gradient_descent_and_descent_from_a_straight_line_is_stuck(letters, monkeypatch):
    monkeypatch.setattr(methods, "DESCENT_STEPS", 60)
    config = configured("fig_3_3", *JC)
    assert config.evaluation.compare_methods
    ends = pose_paths(letters.demonstrations, 100)[letters.skilled.skill.test_demos[0]]
    found = methods.compare_methods(letters.skilled, config.planning, config.robot.frame, ends)
    values = {name.removeprefix("methods."): one.value for name, one in found.evaluation.scores.items()}
    assert np.isfinite(list(values.values())).all() and len(found.curves) == 5
    assert values["graph_100_length"] <= 1.02 * values["graph_50_length"]
    assert values["graph_100_length"] == pytest.approx(values["gradient_from_graph_length"], rel=0.05)
    assert values["gradient_from_line_length"] > 10 * values["gradient_from_graph_length"]


# ---------------------------------------------------------------- Fig. 3.6, 3.7
def test_a_geodesic_into_the_other_cluster_flips_the_quaternion_and_its_energy_gives_it_away(wineglass, wineglass_root):
    planned = wineglass.planned(configured("fig_3_6", *RECORDED, wineglass_root))
    (crossing,), ((_, _, inside),) = planned.plans, planned.others
    assert crossing.status is PlanStatus.crosses and not planned.found
    assert inside.status is PlanStatus.found
    assert crossing.scores.energy > 1000 * inside.scores.energy
    flipped, kept = (one.path.states.orientation for one in (crossing, inside))
    np.testing.assert_allclose(flipped[0], kept[0], atol=1e-6)
    np.testing.assert_allclose(flipped[-1], -kept[-1], atol=1e-6)


def test_geodesics_inside_either_cluster_keep_the_sign_and_turn_the_hand(wineglass, wineglass_root):
    planned = wineglass.planned(configured("fig_3_7", *RECORDED, wineglass_root))
    found = [*planned.plans, *(one for _, _, one in planned.others)]
    assert [one.status for one in found] == [PlanStatus.found] * 7
    orientations = [one.path.states.orientation for one in found]
    turns = [one[0] @ one[-1] for one in orientations]
    assert min(turns) > 0  # less than half a turn, and no flip
    assert np.degrees(2 * np.arccos(turns[0])) > 60
    sides = np.sign([one[0] @ orientations[0][0] for one in orientations])
    np.testing.assert_array_equal(sides, [1, 1, 1, 1, -1, -1, -1])
    goals = np.stack([one.path.states.position_m[-1] for one in found[:4]])
    assert np.linalg.norm(goals[:, None] - goals, axis=2)[np.triu_indices(4, 1)].min() > 0.05


# ---------------------------------------------------------------- Fig. 3.8, 3.9
def test_all_nine_pairs_of_bottle_and_cup_are_planned_from_three_demonstrated_ones(pouring):
    config = configured("fig_3_9", *POURING)
    planner = planners.planner(pouring.skilled, config.planning, config.robot.frame)
    paths = pose_paths(pouring.demonstrations, 100)
    score = pairs(planner, pouring.demonstrations.groups, pouring.skilled, paths).scores["pairs.planned_share"]
    assert (score.value, score.count) == (1.0, 9)


def test_three_geodesics_in_a_row_pour_one_bottle_into_three_cups(pouring):
    planned = pouring.planned(configured("fig_3_9", *POURING))
    assert [one.status for one in planned.plans] == [PlanStatus.found] * 3
    ends = [one.path.states.position_m[[0, -1]] for one in planned.plans]
    for (_, before), (after, _) in pairwise(ends):
        np.testing.assert_allclose(before, after, atol=1e-6)
    across = [leg[-1][0] for leg in ends]
    assert across[0] > across[1] + 0.05 > across[2] + 0.1  # from right to left


def test_a_geodesic_is_replanned_around_the_sphere_where_it_is_at_two_times_and_a_wider_grasp_is_blocked(pouring):
    config = configured("fig_3_8", *POURING)
    planner = planners.planner(pouring.skilled, config.planning, config.robot.frame)
    path = pose_paths(pouring.demonstrations, 100)[0]
    query, bodies = planner.query(path[:1], path[-1:]), moving_bodies(config.obstacle, 3)
    undisturbed = planner.fit(query, planner.search(query, (), 0.0))
    detours_m = []
    for time_s in (0.0, 2.0):
        plan = planner.plan(query, bodies, time_s)
        assert planner.clearances(undisturbed, bodies, time_s).min() < config.planning.clearance_m
        assert plan.scores.clearance_m >= config.planning.clearance_m
        apart = cdist(plan.path.states.position_m, undisturbed.path.states.position_m)
        detours_m.append(apart.min(axis=1).max())
    assert 0.01 < detours_m[0] < detours_m[1]
    wider = replace(config.planning, tool_radius_m=config.planning.tool_radius_m + 0.1)
    planner = planners.planner(pouring.skilled, wider, config.robot.frame)
    assert planner.plan(planner.query(path[:1], path[-1:]), bodies).status is PlanStatus.blocked
