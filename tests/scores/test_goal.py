"""Starts that reach the goal, for a field with a second equilibrium."""

import numpy as np
import pytest

from geomotion.scores.goal import judge_goal
from geomotion.scores.grids import Box, sample_box

STARTS = sample_box(Box(np.array([-1.5, -1.0]), np.array([1.5, 1.0])), 4, seed=0)
GOAL = np.array([1.0, 0.0])


def two_wells(starts, times_s):
    """ẋ = x - x³ in closed form, ẏ = -y: everything left of zero ends at (-1, 0)."""
    x, y = starts[:, None, 0], starts[:, None, 1]
    grown = np.exp(times_s)
    return np.stack([x * grown / np.sqrt(1 + x**2 * (grown**2 - 1)), y * np.exp(-times_s)], axis=-1)


def test_starts_on_the_wrong_side_never_reach_the_goal():
    evaluation = judge_goal(two_wells, GOAL, STARTS, np.linspace(0, 20, 50), tolerance_m=0.01)
    np.testing.assert_array_equal(evaluation.arrays["goal_reached"], STARTS.points[:, 0] > 0)
    score = evaluation.scores["goal.never_reached"]
    assert (score.value, score.count, score.statistic) == (0.5, 16, "share")
    assert score.note.startswith("8 of 16 starts")


def test_being_on_the_way_is_not_being_there():
    score = judge_goal(two_wells, GOAL, STARTS, np.linspace(0, 0.1, 5), tolerance_m=0.01).scores["goal.never_reached"]
    assert score.value == 1.0


def test_diverged_rollouts_never_reach_the_goal():
    def diverge(starts, times_s):
        return np.full((len(starts), len(times_s), 2), np.nan)

    assert judge_goal(diverge, GOAL, STARTS, np.array([0.0, 1.0]), 1.0).scores["goal.never_reached"].value == 1.0


def test_a_wider_tolerance_lets_more_starts_through():
    shares = [
        judge_goal(two_wells, GOAL, STARTS, np.linspace(0, 2, 5), tolerance).scores["goal.never_reached"].value
        for tolerance in (0.01, 0.2, 3.0)
    ]
    assert shares == sorted(shares, reverse=True)
    assert shares[-1] == pytest.approx(0.0)
