"""What the captions of Ch. 4 say, as numbers: the presets `experiment=thesis/fig_4_…` with less data and training."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from geomotion import config as schema
from geomotion.planning.plan import PlanStatus
from geomotion.scores.switching import nearest_groups

from .presets import Trained, configured, trained

SHORT = ["training.spread_steps=150", "training.restarts=0", "training.batch_points=256", "planning.samples=60"]
S_CURVE = [*SHORT, "training.steps=500", "graph.points_per_axis=80", "manifold.kernels=200", "manifold.points=80"]
REACH = [
    *SHORT,
    "training.steps=500",
    "graph.points_per_axis=25",
    "manifold.kernels=300",
    "manifold.points=60",
    "dataset.points=60",
]


@pytest.fixture(scope="module")
def s_curve(tmp_path_factory) -> Trained:
    return trained(configured("fig_4_1", *S_CURVE), tmp_path_factory.mktemp("s_curve"))


@pytest.fixture(scope="module")
def reach(tmp_path_factory) -> Trained:
    return trained(configured("fig_4_7a", *REACH), tmp_path_factory.mktemp("reach"))


@pytest.fixture(scope="module")
def overlap(tmp_path_factory) -> Trained:
    return trained(configured("fig_4_3", *REACH), tmp_path_factory.mktemp("overlap"))


@pytest.mark.parametrize("figure", ["1", "3", "4", "5", "7a", "7b", "7c", "8", "9"])
def test_presets_are_complete(figure):
    config = configured(f"fig_4_{figure}")
    obstructed = figure in ("3", "4", "7b", "7c", "8")
    assert isinstance(config.obstacle, schema.SphereObstacle if obstructed else schema.NoObstacle)


# ---------------------------------------------------------------- Fig. 4.1
def test_two_solutions_are_two_clusters_and_the_geodesic_keeps_to_one(s_curve):
    config = configured("fig_4_1", *S_CURVE)
    (plan,) = s_curve.planned(config).plans
    assert plan.found and plan.scores.line_energy > 100 * plan.scores.energy
    elbow = plan.path.states.joints_rad[:, 1]
    assert (np.sign(elbow) == np.sign(elbow[0])).all()
    across = replace(config, planning=replace(config.planning, goal="demo:1"))
    assert not s_curve.planned(across).found


# ---------------------------------------------------------------- Fig. 4.7, 4.8
def statuses(skill: Trained, figure: str) -> dict[str, PlanStatus]:
    """How planning ended, by the solution in which the geodesic starts."""
    config = configured(figure, *REACH)
    starts = [config.planning.start, *(start for start, _ in config.planning.others)]
    planned = skill.planned(config)
    plans = [*planned.plans, *(plan for _, _, plan in planned.others)]
    groups = [skill.demonstrations.groups[int(start.removeprefix("demo:"))] for start in starts]
    found: dict[str, set[PlanStatus]] = {}
    for group, plan in zip(groups, plans, strict=True):
        found.setdefault(group, set()).add(plan.status)
    assert all(len(one) == 1 for one in found.values()), found
    return {group: one.pop() for group, one in found.items()}


def test_geodesics_are_found_in_each_solution(reach):
    assert set(statuses(reach, "fig_4_7a").values()) == {PlanStatus.found}


def test_a_sphere_in_the_way_of_the_hand_blocks_all_solutions(reach):
    assert set(statuses(reach, "fig_4_7b").values()) == {PlanStatus.blocked}


def test_a_sphere_in_the_way_of_one_elbow_leaves_the_other_solutions(reach):
    found = statuses(reach, "fig_4_7c")
    assert [status.name for status in found.values()].count("blocked") == 1
    assert found["to target 0, elbow +74 deg"] is PlanStatus.blocked


def test_the_arm_follows_a_solution_that_a_sphere_leaves(reach):
    config = configured("fig_4_8", *REACH)
    planned = reach.planned(config)
    (plan,), (check,) = planned.plans, planned.checks
    assert plan.found and check.clearances[0].distance_m >= config.planning.clearance_m
    blocked = replace(config, planning=replace(config.planning, start="demo:13", goal="demo:13"))
    assert reach.planned(blocked).plans[0].status is PlanStatus.blocked


# ---------------------------------------------------------------- Fig. 4.3
def test_the_geodesic_avoids_a_sphere_through_another_solution(overlap):
    config = configured("fig_4_3", *REACH)
    free = overlap.planned(replace(config, obstacle=schema.NoObstacle())).plans[0]
    planned = overlap.planned(config)
    (plan,), (check,) = planned.plans, planned.checks
    assert plan.found and check.clearances[0].distance_m >= config.planning.clearance_m - 5e-4
    manifold = overlap.skilled.manifold
    half_way = [
        nearest_groups(one.path.states, manifold.data.originals, manifold.data.groups)[20:40] for one in (free, plan)
    ]
    solutions = [set(group.tolist()) for group in half_way]
    assert all(one.isdisjoint(other) for one, other in pairwise(solutions)), solutions
