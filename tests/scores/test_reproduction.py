"""Reproduction scores of rollouts that are off by a known amount."""

import numpy as np
import pytest

from geomotion.scores.evaluation import Unit
from geomotion.scores.reproduction import Judged, judge_reproduction

MILLIMETRES = Unit("mm", 1000.0)
TIME = np.linspace(0.0, 2.0, 40)


def judged(height: float, offset: float = 0.0, is_trained: bool = True, speed_factor: float = 1.0) -> Judged:
    """A straight demonstration at some height [m], its rollout beside it."""
    states = np.stack([0.1 * TIME, np.full_like(TIME, height)], axis=1)
    velocities = np.tile([0.1, 0.0], (len(TIME), 1))
    return Judged(TIME, states, velocities, states + np.array([0.0, offset]), speed_factor * velocities, is_trained)


def values(evaluation):
    return {name: score.value for name, score in evaluation.scores.items()}


def test_a_perfect_model_scores_zero_everywhere_and_baselines_do_not():
    evaluation = judge_reproduction([judged(0.0), judged(0.01), judged(0.05, is_trained=False)], MILLIMETRES)
    baseline = {"dtwd_between_demos", "dtwd_to_nearest_demo", "dtwd_of_averaged_demo"}
    for name, value in values(evaluation).items():
        if name.partition(".")[2] in baseline:
            assert value > 1, name
        elif "nearest_neighbour" not in name:
            assert value == 0, name


def test_a_rollout_beside_its_demonstration_is_off_by_that_distance_in_millimetres():
    found = values(judge_reproduction([judged(0.0, 0.002), judged(0.01, 0.002)], MILLIMETRES))
    assert found["train.dtwd_per_point"] == pytest.approx(4.0)
    assert found["train.dtwd_sum"] == pytest.approx(4.0 * 40)
    assert found["train.dtw_sum"] == pytest.approx(2.0 * 40)
    for name in ("dtw", "frechet", "start_error", "end_point_error", "time_aligned_rmse"):
        assert found[f"train.{name}"] == pytest.approx(2.0), name


def test_ratios_compare_with_what_people_do():
    evaluation = judge_reproduction(
        [judged(0.0, 0.002), judged(0.01, 0.004), judged(0.016, 0.003, is_trained=False)], MILLIMETRES
    )
    found = values(evaluation)
    assert found["train.dtwd_between_demos"] == pytest.approx(20.0)
    assert found["train.dtwd_ratio"] == pytest.approx(6.0 / 20.0)
    assert found["heldout.dtwd_to_nearest_demo"] == pytest.approx(12.0)
    assert found["heldout.ratio_to_nearest_demo"] == pytest.approx(6.0 / 12.0)
    assert found["train.dtwd_of_averaged_demo"] == pytest.approx(10.0)
    assert found["heldout.dtwd_of_averaged_demo"] == pytest.approx(22.0)


def test_velocity_errors_are_pooled_over_points_and_spread_over_demonstrations():
    evaluation = judge_reproduction([judged(0.0, speed_factor=1.3), judged(0.01, speed_factor=0.9)], MILLIMETRES)
    relative = evaluation.scores["train.relative_velocity_error"]
    assert relative.value == pytest.approx(np.sqrt((0.3**2 + 0.1**2) / 2))
    assert relative.values == pytest.approx((0.3, 0.1))
    assert relative.statistic == "pooled"
    absolute = evaluation.scores["train.velocity_rmse"]
    assert absolute.value == pytest.approx(100 * relative.value)  # recorded speed is 100 mm/s
    assert absolute.unit == "mm/s"


def test_the_nearest_neighbour_never_sees_the_demonstration_it_is_judged_on():
    still = judged(0.0)
    moving = Judged(
        TIME, still.states + np.array([0.0, 0.5]), 3 * still.velocities, still.states, still.velocities, True
    )
    found = values(judge_reproduction([still, moving], MILLIMETRES))
    assert found["train.nearest_neighbour_velocity_error"] == pytest.approx(np.sqrt((2**2 + 2**2) / (1 + 3**2)))


def test_a_single_demonstration_has_no_baseline_and_says_so():
    evaluation = judge_reproduction([judged(0.0)], MILLIMETRES)
    assert "train.dtwd_ratio" not in evaluation.scores
    assert "at least two" in evaluation.omitted["train.dtwd_ratio"]
    assert "heldout" in evaluation.omitted


def test_arrays_keep_every_judged_demonstration_with_its_subset():
    arrays = judge_reproduction([judged(0.0), judged(0.01, 0.001, is_trained=False)], MILLIMETRES).arrays
    assert [str(arrays[f"set_{number}"]) for number in (0, 1)] == ["train", "test"]
    np.testing.assert_allclose(arrays["rollout_1"] - arrays["demo_1"], np.tile([0, 0.001], (40, 1)), atol=1e-15)
    assert all(array.dtype != object for array in arrays.values())
