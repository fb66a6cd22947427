"""Judging geodesics: ratios to what separates demonstrations, and what cannot be judged."""

from dataclasses import replace

import numpy as np
import pytest

from geomotion.planning.manifold import DecodedPath
from geomotion.planning.plan import PathScores, Plan, PlanStatus
from geomotion.planning.planner import Planner
from geomotion.scores.configurations import ConfigurationPath, ConfigurationSupport, joint_dtwd
from geomotion.scores.paths import MotionPath, PosePath, dtwd_ratio
from geomotion.scores.pose_support import PoseSupport
from geomotion.stages.evaluate_geodesics import Judged, score

SCORES = PathScores(2.0, 2.0, 4.0, 5.0, np.inf, 0.01, 0.1)


def bow(height_m: float, turn_rad: float = 0.0, points: int = 50) -> PosePath:
    share = np.linspace(0, 1, points)
    position = np.stack([share, height_m * np.sin(np.pi * share), 0 * share], axis=1)
    half = (0.5 + turn_rad) * share / 2
    return PosePath(position, np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1))


def judged(path: MotionPath | None, others: list[MotionPath], demonstration: MotionPath) -> Judged:
    if path is None:
        plan = Plan(PlanStatus.blocked, "obstacles", np.zeros((0, 2)))
    else:
        codes = np.zeros((len(path), 2))
        plan = Plan(PlanStatus.found, "found", codes, DecodedPath(path, np.linspace(0, 1, len(path))), SCORES)
    return Judged(3, demonstration, plan, others[0], path, others)


class Settings:
    cap_m = 0.05


class OnlyItsSupport(Planner):
    def __init__(self, paths, kind=PoseSupport):
        self.support, self.settings = kind.of(paths), Settings()


def names(*ones: Judged):
    evaluation = score(OnlyItsSupport([one.demonstration for one in ones]), ones, "heldout")
    return evaluation, {name.removeprefix("heldout.") for name in evaluation.scores}


def test_the_ratio_is_that_of_the_scores():
    one = judged(bow(0.25, 0.1), [bow(0.3, 0.3), bow(0.1, -0.2)], bow(0.2))
    expected = dtwd_ratio(bow(0.25, 0.1), bow(0.2), one.others)
    found = one.ratio(bow(0.25, 0.1))
    assert found == pytest.approx({"position": expected.position, "orientation": expected.orientation})


def bends(height_rad: float, points: int = 50) -> ConfigurationPath:
    """Two joints, of which the first turns the hand about the origin, and the second changes nothing."""
    share = np.linspace(0, 1, points)

    def kinematics(joints_rad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        angle, none = joints_rad[:, 0], np.zeros(len(joints_rad))
        position = np.stack([np.cos(angle), np.sin(angle), none], axis=1)
        return position, np.stack([np.cos(angle / 2), none, none, np.sin(angle / 2)], axis=1)

    return ConfigurationPath(np.stack([share, height_rad * np.sin(np.pi * share)], axis=1), kinematics)


def test_configurations_are_judged_in_their_joints_too():
    one = judged(bends(0.25), [bends(0.3), bends(0.1)], bends(0.2))
    between = [joint_dtwd(bends(0.2), other) for other in one.others]
    found = one.ratio(bends(0.25))
    assert found["joint"] == pytest.approx(joint_dtwd(bends(0.25), bends(0.2)) / np.mean(between))
    assert np.isnan([found["position"], found["orientation"]]).all()  # the hand moves the same way in all of them
    evaluation = score(OnlyItsSupport([one.demonstration], ConfigurationSupport), [one], "heldout")
    assert evaluation.scores["heldout.joint_dtwd_ratio"].value == pytest.approx(found["joint"])
    of_averaged = one.ratio(one.averaged)["joint"]
    assert evaluation.scores["heldout.joint_dtwd_ratio_of_averaged_demo"].value == pytest.approx(of_averaged)
    assert set(evaluation.omitted) == {"heldout.position_dtwd_ratio", "heldout.orientation_dtwd_ratio"}
    np.testing.assert_array_equal(evaluation.arrays["geodesic_3_joints_rad"], bends(0.25).joints_rad)


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
