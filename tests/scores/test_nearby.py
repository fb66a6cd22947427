"""Distances between nearby rollouts of fields that contract at a known rate."""

import numpy as np
import pytest
import torch

from geomotion.scores.array_field import ArrayField
from geomotion.scores.nearby import judge_nearby, nearby_starts, pairwise_distances

TIMES = np.linspace(0.0, 3.0, 61)
STARTS = nearby_starts(np.array([0.8, -0.5]), count=5, deviation=0.05, seed=3)


def judge(field, proven_rate, starts=STARTS):
    array_field = ArrayField(field)
    return judge_nearby(array_field.roll, array_field.to_claimed, starts, TIMES, proven_rate)


def test_starts_scatter_around_the_given_one_repeatably():
    starts = nearby_starts(np.zeros(2), count=4000, deviation=0.05, seed=3)
    np.testing.assert_allclose(starts.mean(axis=0), 0, atol=0.003)
    np.testing.assert_allclose(starts.std(axis=0), 0.05, rtol=0.05)
    np.testing.assert_array_equal(STARTS, nearby_starts(np.array([0.8, -0.5]), 5, 0.05, 3))


def test_every_pair_is_compared_at_equal_times():
    trajectories = np.array([[[0.0, 0.0], [1.0, 0.0]], [[0.0, 1.0], [1.0, 3.0]], [[4.0, 0.0], [1.0, 4.0]]])
    np.testing.assert_allclose(pairwise_distances(trajectories), [[1, 3], [4, 4], [np.sqrt(17), 1]])


def test_an_isotropic_linear_field_meets_its_bound_exactly(plain_linear):
    evaluation = judge(plain_linear(rate=1.5, time_unit_s=3.0), proven_rate=0.5)
    expected = evaluation.arrays["nearby_euclidean"][0] * np.exp(-0.5 * TIMES)
    for name in ("nearby_euclidean", "nearby_claimed", "nearby_bound"):
        np.testing.assert_allclose(evaluation.arrays[name], expected)
    scores = evaluation.scores
    assert scores["nearby.euclidean.final_ratio"].value == pytest.approx(np.exp(-1.5))
    assert scores["nearby.euclidean.max_expansion"].value == 1.0
    assert scores["nearby.euclidean.growing_share"].value == 0.0
    assert scores["nearby.claimed.bound_excess"].value == pytest.approx(0.0, abs=1e-12)


def test_a_bound_that_promises_too_much_is_seen_to_break(plain_linear):
    excess = judge(plain_linear(rate=0.5), proven_rate=0.6).scores["nearby.claimed.bound_excess"].value
    assert excess == pytest.approx(np.max(np.exp(-0.5 * TIMES) - np.exp(-0.6 * TIMES)))


def test_distances_may_grow_for_the_eye_while_they_fall_in_the_claimed_metric(spiral):
    wide_starts = nearby_starts(np.array([1.5, -3.0]), count=4, deviation=0.05, seed=1)
    evaluation = judge(spiral(rate=1.0, spin=4.0, time_unit_s=2.0), proven_rate=0.5, starts=wide_starts)
    assert evaluation.scores["nearby.euclidean.max_expansion"].value > 1.2
    assert evaluation.scores["nearby.euclidean.growing_share"].value > 0.1
    assert evaluation.scores["nearby.claimed.growing_share"].value == 0.0
    assert evaluation.scores["nearby.claimed.bound_excess"].value <= 1e-12


def test_without_a_proven_rate_there_is_no_bound(plain_linear):
    evaluation = judge(plain_linear(), proven_rate=None)
    assert evaluation.arrays["nearby_bound"].size == 0
    assert "nearby.claimed.bound_excess" not in evaluation.scores
    assert "proves no rate" in evaluation.omitted["nearby.claimed.bound_excess"]


def test_a_single_start_has_nothing_to_be_compared_with(plain_linear):
    assert "nearby_starts" in judge(plain_linear(), None, starts=STARTS[:1]).omitted["nearby"]


def test_the_array_field_answers_in_double_precision_whatever_the_fields_own(plain_linear):
    field = ArrayField(plain_linear().float())
    assert field.tensor(STARTS).dtype == torch.float32
    assert field.roll(STARTS, TIMES).dtype == field.velocity(STARTS).dtype == np.float64
    np.testing.assert_allclose(field.velocity(STARTS), -STARTS, rtol=1e-6)
