"""A planner through the interface of fields: whole motions, no velocities."""

import pytest
import torch
from torch.testing import assert_close

from geomotion.baselines.movement_primitive import MovementPrimitive
from geomotion.dynamics.charts import IdentityChart
from geomotion.dynamics.fields import ChartedField, Plan, SolvableField
from geomotion.dynamics.rollout import RolloutStatus, rollout
from geomotion.errors import InvalidSetting

STARTS = torch.tensor([[1.0, 0.0], [1.0, 0.5], [1.0, 1.0]])
DURATIONS = (1.0, 1.5, 2.0)


@pytest.fixture(scope="module")
def lines() -> MovementPrimitive:
    """Straight lines to the origin, slower from farther up."""
    times = [torch.linspace(0, duration, 80) for duration in DURATIONS]
    states = [(1 - time[:, None] / time[-1]) * start for time, start in zip(times, STARTS, strict=True)]
    primitive = MovementPrimitive(2, weights=12)
    primitive.start_from(times, states, states)
    return primitive


def test_a_motion_between_shown_ones_is_between_them_in_shape_and_time(lines):
    start = torch.tensor([1.0, 0.25])
    times = torch.linspace(0, 1.25, 20)  # of the durations 1 and 1.5 the mean
    assert_close(lines.solve(start, times), (1 - times[:, None] / 1.25) * start, atol=0.02, rtol=0)


def test_a_motion_stays_at_its_end(lines):
    late = lines.solve(STARTS[0], torch.tensor([0.0, 1.0, 5.0]))
    assert_close(late[1], late[2], atol=1e-3, rtol=0)


@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
def test_motions_begin_at_their_starts_in_batches_of_any_shape(lines, batch):
    start = torch.rand(*batch, 2)
    motions = lines.solve(start, torch.linspace(0, 1, 7))
    assert motions.shape == (*batch, 7, 2)
    assert_close(motions[..., 0, :], start, atol=1e-2, rtol=0)


def test_it_is_followed_as_a_solvable_field_and_refuses_to_give_velocities(lines):
    assert isinstance(lines, Plan) and isinstance(lines, SolvableField)
    field = ChartedField(IdentityChart(2), lines, time_unit_s=1.0)
    followed = rollout(field, STARTS, torch.linspace(0, 3, 10), goal=torch.zeros(2), goal_tolerance=0.05)
    assert followed.method == "closed_form"
    assert followed.statuses == (RolloutStatus.reached,) * 3
    with pytest.raises(InvalidSetting, match="plans whole motions"):
        field(STARTS)
