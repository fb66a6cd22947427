"""Joint scores of fields whose trajectories are known."""

import numpy as np
import pytest

from geomotion.scores.array_field import ArrayField
from geomotion.scores.joints import ReturnProtocol, follow_displaced, judge_joints, judge_returns
from geomotion.scores.reproduction import Judged

RATE = 3.0
TIME_S = np.linspace(0, 2, 401)
START = np.array([0.8, -0.4, 0.2])
PROTOCOL = ReturnProtocol(count=12, offset_rad=0.5, seed=1)


@pytest.fixture
def field(plain_linear) -> ArrayField:
    """ẋ = -RATE x."""
    return ArrayField(plain_linear(rate=RATE, dim=3))


def decaying(start=START):
    return np.exp(-RATE * TIME_S)[:, None] * start


def judged(error=0.0, is_trained=True):
    states = decaying()
    return Judged(TIME_S, states, -RATE * states, states + error, -RATE * states, is_trained)


def test_every_joint_is_off_by_the_same_to_all_sides():
    offsets = PROTOCOL.offsets(44)
    assert set(np.abs(offsets).ravel()) == {0.5}
    assert offsets[0].min() == 0.5
    assert offsets[1].max() == -0.5
    assert abs(offsets[2:].mean()) < 0.1


def test_errors_are_those_of_joints_in_degrees():
    errors = np.radians([3.0, 0.0, 4.0, 50.0])
    one = Judged(TIME_S, np.zeros((401, 4)), np.zeros((401, 4)), np.tile(errors, (401, 1)), np.zeros((401, 4)), True)
    scores = judge_joints([one], joints=3).scores
    assert scores["train.joint_rmse"].value == pytest.approx(5 / np.sqrt(3))
    assert scores["train.joint_rmse_worst_joint"].value == pytest.approx(4)
    assert "heldout.joint_rmse" not in scores


def test_held_out_demonstrations_stand_apart():
    scores = judge_joints([judged(), judged(np.radians(2.0), is_trained=False)], joints=3).scores
    assert scores["train.joint_rmse"].value == 0
    assert scores["heldout.joint_rmse"].value == pytest.approx(2.0)


def test_offsets_decay_as_the_field_says(field):
    offsets = PROTOCOL.offsets(3)
    found = follow_displaced(field.exact(), judged(), offsets)
    decay = 0.5 * np.exp(-RATE * TIME_S)
    np.testing.assert_allclose(found.at_equal_time_rad, np.tile(decay, (12, 1)), atol=1e-9)
    np.testing.assert_allclose(found.claimed, np.tile(np.sqrt(3) * decay, (12, 1)), atol=1e-9)
    ratio = np.linalg.norm(START + offsets, axis=1) / np.linalg.norm(START)
    np.testing.assert_allclose(found.speed_ratio, ratio, rtol=1e-9)
    # straight to the goal: what is left of the path is what is across it
    ahead = -START / np.linalg.norm(START)
    across = np.linalg.norm(offsets - (offsets @ ahead)[:, None] * ahead, axis=1) / np.sqrt(3)
    behind = offsets @ ahead < 0
    early = TIME_S < 0.05
    beside = (across[:, None] * np.exp(-RATE * TIME_S))[~behind]
    np.testing.assert_allclose(found.to_path_rad[~behind][:, early], beside[:, early], atol=2e-3)


def test_times_until_back_and_the_bound_follow(field):
    found = judge_returns(field, [judged()], 3, PROTOCOL, proven_rate=RATE)
    latest = np.log(0.5 / np.radians(3)) / RATE
    assert found.scores["returns.back_within_3deg_share"].value == 1
    assert 0 < found.scores["returns.back_within_3deg_worst"].value <= latest + 0.01
    assert found.scores["returns.left_at_end_equal_time"].value == pytest.approx(np.degrees(0.5 * np.exp(-2 * RATE)))
    assert abs(found.scores["returns.claimed.bound_excess"].value) < 1e-9
    assert judge_returns(field, [judged()], 3, PROTOCOL, 2 * RATE).scores["returns.claimed.bound_excess"].value > 0.1


def test_without_a_proof_the_bound_is_left_out(field):
    found = judge_returns(field, [judged()], 3, PROTOCOL, proven_rate=None)
    assert "returns.claimed" in found.omitted
    assert "returns.claimed.bound_excess" not in found.scores


def test_starts_are_shared_among_demonstrations(field):
    whole = judge_returns(field, [judged(), judged()], 3, PROTOCOL, None)
    assert whole.scores["returns.left_at_end"].count == PROTOCOL.count
    one = ReturnProtocol(count=1, offset_rad=0.5, seed=0)
    assert judge_returns(field, [judged(), judged()], 3, one, None).scores["returns.left_at_end"].count == 1
