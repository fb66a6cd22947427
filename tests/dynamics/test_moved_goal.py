"""A goal that moves on the way."""

import pytest
import torch

from geomotion.dynamics.charts import IdentityChart
from geomotion.dynamics.fields import ChartedField, TimedField
from geomotion.dynamics.linear import LinearField
from geomotion.dynamics.moved_goal import MovedGoal
from geomotion.dynamics.rollout import rollout
from geomotion.errors import ShapeMismatch

RATE = 2.0
SHIFTS = torch.tensor([[0.1, 0.0], [0.1, -0.2]], dtype=torch.float64)
CHANGES_S = torch.tensor([0.5, 1.5], dtype=torch.float64)


@pytest.fixture
def moved() -> MovedGoal:
    field = ChartedField(IdentityChart(2), LinearField(2, 1.0, RATE).double(), 1.0)
    return MovedGoal(field, CHANGES_S, SHIFTS)


def test_the_shift_is_that_of_the_last_change(moved):
    times = torch.tensor([0.0, 0.49, 0.5, 1.4, 1.5, 9.0], dtype=torch.float64)[:, None]
    expected = torch.tensor([[0, 0], [0, 0], [0.1, 0], [0.1, 0], [0.1, -0.2], [0.1, -0.2]], dtype=torch.float64)
    torch.testing.assert_close(moved.shift(times), expected)


def test_trajectories_end_at_the_moved_goal_and_approach_each_other_at_the_same_rate(moved):
    starts = torch.tensor([[0.5, 0.2, 0.0], [-0.1, 0.4, 0.0]], dtype=torch.float64)
    times = torch.linspace(0, 8, 161, dtype=torch.float64)
    found = rollout(TimedField(moved), starts, times, method="rk4").states[..., :2]
    torch.testing.assert_close(found[:, -1], SHIFTS[1].expand(2, 2), atol=1e-5, rtol=0)
    apart = (found[0] - found[1]).norm(dim=-1)
    torch.testing.assert_close(apart, apart[0] * (-RATE * times).exp(), atol=1e-6, rtol=0)


def test_every_change_has_its_shift(moved):
    with pytest.raises(ShapeMismatch, match="shifts of the goal"):
        MovedGoal(moved.field, CHANGES_S[:1], SHIFTS)
