"""Judging geodesics: ratios to what separates demonstrations, and what cannot be judged."""

from dataclasses import replace

import numpy as np
import pytest

from geomotion.planning.manifold import DecodedPath
from geomotion.planning.plan import PathScores, Plan, PlanStatus
from geomotion.planning.planner import Planner
from geomotion.scores.paths import PosePath, dtwd_ratio
from geomotion.scores.pose_support import PoseSupport
from geomotion.stages.evaluate_geodesics import Judged, score

SCORES = PathScores(2.0, 2.0, 4.0, 5.0, np.inf, 0.01, 0.1)


def bow(height_m: float, turn_rad: float = 0.0, points: int = 50) -> PosePath:
    share = np.linspace(0, 1, points)
    position = np.stack([share, height_m * np.sin(np.pi * share), 0 * share], axis=1)
    half = (0.5 + turn_rad) * share / 2
    return PosePath(position, np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1))


def judged(path: PosePath | None, others: list[PosePath], demonstration: PosePath) -> Judged:
    if path is None:
        plan = Plan(PlanStatus.blocked, "obstacles", np.zeros((0, 2)))
    else:
        codes = np.zeros((len(path), 2))
        plan = Plan(PlanStatus.found, "found", codes, DecodedPath(path, np.linspace(0, 1, len(path))), SCORES)
    return Judged(3, demonstration, plan, others[0], path, others)


class Settings:
    cap_m = 0.05


class OnlyItsSupport(Planner):
    def __init__(self, paths):
        self.support, self.settings = PoseSupport.of(paths), Settings()


def names(*ones: Judged):
    evaluation = score(OnlyItsSupport([one.demonstration for one in ones]), ones, "heldout")
    return evaluation, {name.removeprefix("heldout.") for name in evaluation.scores}


def test_the_ratio_is_that_of_the_scores():
    one = judged(bow(0.25, 0.1), [bow(0.3, 0.3), bow(0.1, -0.2)], bow(0.2))
    expected = dtwd_ratio(bow(0.25, 0.1), bow(0.2), one.others)
    found = one.ratio(bow(0.25, 0.1))
    assert (found.position, found.orientation) == pytest.approx((expected.position, expected.orientation))


def test_a_part_in_which_demonstrations_do_not_differ_is_left_out_with_the_reason():
    evaluation, found = names(judged(bow(0.25), [bow(0.3), bow(0.1)], bow(0.2)))
    assert {"position_dtwd_ratio", "position_dtwd_ratio_of_averaged_demo"} <= found
    assert not [name for name in found if name.startswith("orientation_dtwd_ratio")]
    assert evaluation.omitted == {"heldout.orientation_dtwd_ratio": "the demonstrations do not differ in orientation"}


def test_demonstrations_alike_set_no_measure_but_are_judged():
    evaluation, found = names(judged(bow(0.25), [bow(0.2)], bow(0.2)))
    assert "position_dtwd_per_point" in found
    assert set(evaluation.omitted) == {"heldout.position_dtwd_ratio", "heldout.orientation_dtwd_ratio"}
    assert all(np.isfinite(one.value) for one in evaluation.scores.values())


def test_only_those_with_a_measure_are_averaged():
    measured = judged(bow(0.25, 0.1), [bow(0.3, 0.3)], bow(0.2))
    alike = replace(measured, others=[bow(0.2)])
    evaluation, _ = names(measured, alike)
    assert evaluation.scores["heldout.position_dtwd_ratio"].count == 1
    assert evaluation.scores["heldout.position_dtwd_per_point"].count == 2


def test_demonstrations_without_a_path_count_and_their_reason_is_kept():
    evaluation, found = names(judged(None, [bow(0.3)], bow(0.2)))
    assert found == {"planned_share"}
    assert evaluation.scores["heldout.planned_share"].value == 0
    assert evaluation.omitted == {"heldout.demonstration 3": "obstacles"}
