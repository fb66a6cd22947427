"""Pushed motions of fields whose trajectories are known."""

import numpy as np
import pytest
import torch

from geomotion.dynamics.charts import IdentityChart
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.time_law import SplineTimeLaw
from geomotion.scores.array_field import ArrayField
from geomotion.scores.pushes import TIMES_PER_DURATION, PushProtocol, follow_pushed, judge_pushes, settled

RATE, DURATION_S = 3.0, 2.0
STARTS = np.array([[0.4, 0.0, 0.1], [0.2, 0.3, 0.0]])
PROTOCOL = PushProtocol(count=40, size_m=0.05, at=0.4, duration_s=DURATION_S, seed=1)


@pytest.fixture
def field(plain_linear) -> ArrayField:
    """ẋ = -RATE x / DURATION_S: straight to the origin."""
    return ArrayField(plain_linear(rate=RATE, dim=3, time_unit_s=DURATION_S))


def distances_after(shares: np.ndarray) -> np.ndarray:
    """Of the offsets, whose part across the straight way to the origin decays."""
    ahead = -STARTS[np.arange(PROTOCOL.count) % 2]
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    offsets = PROTOCOL.offsets(3)
    across = np.linalg.norm(offsets - (offsets * ahead).sum(axis=1, keepdims=True) * ahead, axis=1)
    return across[:, None] * np.exp(-RATE * shares)


def test_pushes_point_anywhere_and_move_the_position_alone():
    offsets = PushProtocol(2000, 0.05, 0.4, 1.0, 0).offsets(6)
    np.testing.assert_allclose(np.linalg.norm(offsets[:, :3], axis=1), 0.05)
    np.testing.assert_allclose(offsets.mean(axis=0), 0, atol=2e-3)
    assert not offsets[:, 3:].any()


def test_offsets_decay_towards_a_straight_path_as_the_field_says(field):
    pushed = follow_pushed(field, STARTS, PROTOCOL)
    shares = pushed.time_s / DURATION_S
    np.testing.assert_allclose(pushed.to_path_m, distances_after(shares), atol=1e-3)
    at_equal_time = np.tile(0.05 * np.exp(-RATE * shares), (PROTOCOL.count, 1))
    np.testing.assert_allclose(pushed.at_equal_time_m, at_equal_time, atol=1e-9)
    np.testing.assert_allclose(pushed.claimed, at_equal_time, atol=1e-9)
    undisturbed = np.exp(-RATE * PROTOCOL.at) * STARTS[np.arange(PROTOCOL.count) % 2]
    ratio = np.linalg.norm(undisturbed + PROTOCOL.offsets(3), axis=1) / np.linalg.norm(
        STARTS[np.arange(PROTOCOL.count) % 2], axis=1
    )
    np.testing.assert_allclose(pushed.speed_ratio, ratio)


def test_scores_are_those_of_the_closed_form(field):
    scores = judge_pushes(field, STARTS, PROTOCOL, RATE / DURATION_S).scores
    across = distances_after(np.zeros(1))[:, 0]
    for limit_mm, within in ((25, 0.06), (10, 0.25)):
        times = np.log(np.maximum(across / (limit_mm / 1000), 1)) / RATE
        share = scores[f"pushes.back_within_{limit_mm}mm_share"]
        assert share.value == pytest.approx((times <= within).mean(), abs=1 / PROTOCOL.count)
        assert scores[f"pushes.back_within_{limit_mm}mm"].value == pytest.approx(100 * times.mean(), abs=0.5)
        assert scores[f"pushes.back_within_{limit_mm}mm_worst"].value == pytest.approx(100 * times.max(), abs=0.5)
    left_mm = 50 * np.exp(-RATE * 0.6)
    assert scores["pushes.left_at_end_equal_time"].value == pytest.approx(left_mm, rel=1e-6)
    assert scores["pushes.left_at_end"].value == pytest.approx(1000 * distances_after(np.array([0.6])).mean(), abs=0.2)
    assert scores["pushes.peak_speed_share"].value == 1.0
    assert scores["pushes.claimed.bound_excess"].value == pytest.approx(0, abs=1e-9)
    assert scores["pushes.claimed.recovery_ratio"].value == pytest.approx(1.0, abs=0.01)


def test_without_a_proven_rate_nothing_is_said_of_it(field):
    evaluation = judge_pushes(field, STARTS, PROTOCOL, None)
    assert "pushes.claimed" in evaluation.omitted
    assert not any(name.startswith("pushes.claimed") for name in evaluation.scores)


def test_after_a_push_a_time_law_goes_on_where_it_was(plain_linear):
    law = SplineTimeLaw(8, 0.1).double()
    with torch.no_grad():
        law.raw_speeds.copy_(torch.linspace(-1, 1, 9))
    linear = plain_linear(rate=RATE, dim=3).field
    field = ChartedField(IdentityChart(3), linear, DURATION_S, law).double()
    pushed = follow_pushed(ArrayField(field), STARTS, PROTOCOL)
    shares = torch.tensor(0.4 + pushed.time_s / DURATION_S)
    progress = (law.progress(shares) - law.progress(shares[:1])).detach().numpy()
    np.testing.assert_allclose(pushed.at_equal_time_m[0], 0.05 * np.exp(-RATE * progress), atol=1e-6)


def test_back_means_to_stay():
    shares = np.arange(4) / TIMES_PER_DURATION
    distances = np.array([[9.0, 9, 9, 9], [9, 1, 9, 1], [1, 1, 1, 1], [9, 1, 1, np.inf], [9, 2, 2, 2]])
    np.testing.assert_array_equal(settled(distances, shares, 2.0), [np.inf, shares[3], 0, np.inf, shares[1]])
