"""Rollouts: order of convergence, choice of method, failures of the adaptive solver, verdicts."""

import math
from itertools import pairwise

import pytest
import torch
from torch import nn
from torch.testing import assert_close

from geomotion.dynamics.charts import IdentityChart
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.rollout import RolloutStatus, rollout
from geomotion.errors import InvalidSetting

MATRIX = torch.tensor([[-0.5, 2.0], [-2.0, -0.8]], dtype=torch.float64)
STARTS = torch.tensor([[1.0, 0.0], [-0.5, 2.0], [0.3, 0.3]], dtype=torch.float64)
TIMES = torch.linspace(1, 4, 13, dtype=torch.float64)


class Field(nn.Module):
    """A field from a function."""

    def __init__(self, function, dim: int = 2) -> None:
        super().__init__()
        self.dim, self.function = dim, function

    def forward(self, x):
        return self.function(x)


class SolvableLinear(Field):
    """The linear field with its matrix exponential; counts how often it is solved."""

    solved = 0

    def solve(self, start, times):
        self.solved += 1
        return torch.einsum("tij,...j->...ti", torch.linalg.matrix_exp(MATRIX * times[:, None, None]), start)


def linear() -> Field:
    return Field(lambda x: x @ MATRIX.T)


def solvable() -> SolvableLinear:
    return SolvableLinear(lambda x: x @ MATRIX.T)


def exact() -> torch.Tensor:
    return solvable().solve(STARTS, TIMES - TIMES[0])


# ---------------------------------------------------------------- accuracy
def test_states_begin_at_the_starts_and_follow_the_matrix_exponential():
    result = rollout(linear(), STARTS, TIMES, substeps=20)
    assert result.method == "rk4"
    assert_close(result.states[:, 0], STARTS, rtol=0, atol=0)
    assert_close(result.states, exact(), rtol=1e-7, atol=1e-7)


def test_runge_kutta_converges_with_order_four():
    errors = [(rollout(linear(), STARTS, TIMES, substeps=n).states - exact()).abs().max().item() for n in (1, 2, 4, 8)]
    slopes = [math.log2(coarse / fine) for coarse, fine in pairwise(errors)]
    assert slopes == pytest.approx([4.0] * 3, abs=0.2)


def test_unequal_times_are_honoured():
    times = torch.tensor([0.0, 0.1, 0.7, 2.0], dtype=torch.float64)
    assert_close(
        rollout(linear(), STARTS, times, substeps=40).states, solvable().solve(STARTS, times), rtol=1e-6, atol=1e-6
    )


@pytest.mark.parametrize("tolerance", [1e-4, 1e-7])
def test_the_adaptive_solver_keeps_its_tolerance_for_each_of_many_starts(tolerance):
    crowd = torch.cat([STARTS, torch.zeros(500, 2, dtype=torch.float64)])  # a mean over them would hide three errors
    result = rollout(
        linear(), crowd, TIMES, method="dopri5", relative_tolerance=tolerance, absolute_tolerance=tolerance
    )
    assert result.method == "dopri5"
    assert (result.states[:3] - exact()).abs().max() < 10 * tolerance


@pytest.mark.parametrize("method", ["rk4", "dopri5", "closed_form"])
def test_states_keep_single_precision_whatever_the_precision_of_the_times(method):
    single = MATRIX.float()

    class Single(SolvableLinear):
        def solve(self, start, times):
            return torch.einsum("tij,...j->...ti", torch.linalg.matrix_exp(single * times[:, None, None]), start)

    result = rollout(Single(lambda x: x @ single.T), STARTS.float(), TIMES, method=method, substeps=10)
    assert (result.method, result.note) == (method, "")
    assert_close(result.states, exact().float(), rtol=1e-4, atol=1e-5)


def test_no_gradient_is_kept():
    assert not rollout(linear(), STARTS.clone().requires_grad_(), TIMES).states.requires_grad


# ---------------------------------------------------------------- choice of method
def test_the_closed_form_is_taken_where_there_is_one():
    field = solvable()
    result = rollout(field, STARTS, TIMES)
    assert (result.method, field.solved) == ("closed_form", 1)
    assert_close(result.states, exact())


def test_a_numerical_method_can_be_asked_for_all_the_same():
    field = solvable()
    assert rollout(field, STARTS, TIMES, method="rk4").method == "rk4"
    assert field.solved == 0


def test_a_charted_field_is_solved_exactly_if_its_latent_field_can_be():
    assert rollout(ChartedField(IdentityChart(2), solvable(), 1.0), STARTS, TIMES).method == "closed_form"
    assert rollout(ChartedField(IdentityChart(2), linear(), 1.0), STARTS, TIMES).method == "rk4"


def test_asking_for_a_closed_form_that_does_not_exist_is_refused():
    with pytest.raises(InvalidSetting, match="no closed form"):
        rollout(linear(), STARTS, TIMES, method="closed_form")


# ---------------------------------------------------------------- the adaptive solver fails
def jumping() -> Field:
    """Slides along the line x_0 = 0, across which the velocity jumps: no step size is small enough."""
    return Field(lambda x: torch.stack([-1e6 * x[..., 0].sign(), -x[..., 1]], dim=-1))


def test_where_the_step_size_collapses_rk4_takes_over_and_says_so():
    result = rollout(
        jumping(), STARTS, TIMES, method="dopri5", relative_tolerance=1e-12, absolute_tolerance=1e-12, substeps=3
    )
    assert result.method == "rk4"
    assert "underflow in dt" in result.note
    assert_close(result.states, rollout(jumping(), STARTS, TIMES, substeps=3).states)


def test_other_assertions_are_not_swallowed():
    with pytest.raises(AssertionError, match="increasing"):
        rollout(linear(), STARTS, TIMES.clone().index_fill_(0, torch.tensor([3]), 0.0), method="dopri5")


# ---------------------------------------------------------------- verdicts
SINK = Field(lambda x: -5 * x)
DRIFT = Field(lambda x: torch.ones_like(x))
EXPLOSION = Field(lambda x: x**3)
ONE = torch.ones(1, 2, dtype=torch.float64)
BOX = (-2 * ONE[0], 2 * ONE[0])


@pytest.mark.parametrize(
    ("field", "goal", "expected"),
    [
        (SINK, 0 * ONE[0], RolloutStatus.reached),
        (SINK, ONE[0], RolloutStatus.stopped_elsewhere),
        (SINK, None, RolloutStatus.stopped_elsewhere),
        (DRIFT, 0 * ONE[0], RolloutStatus.left_region),
        (DRIFT, 4 * ONE[0], RolloutStatus.reached),
        (EXPLOSION, 0 * ONE[0], RolloutStatus.diverged),
    ],
)
def test_each_ending_is_named(field, goal, expected):
    times = torch.linspace(0, 3, 60, dtype=torch.float64)
    result = rollout(field, ONE, times, substeps=20, goal=goal, goal_tolerance=1e-3, region=BOX)
    assert result.statuses == (expected,)


def test_a_trajectory_that_has_not_arrived_is_still_moving():
    times = torch.linspace(0, 0.2, 10, dtype=torch.float64)
    assert rollout(SINK, ONE, times, goal=0 * ONE[0], region=BOX).statuses == (RolloutStatus.moving,)


def test_each_trajectory_is_judged_for_itself():
    two_wells = Field(lambda x: x - x**3)
    starts = torch.tensor([[0.5, 0.5], [-0.5, 0.5], [0.0, 0.0]], dtype=torch.float64)
    times = torch.linspace(0, 20, 200, dtype=torch.float64)
    result = rollout(two_wells, starts, times, goal=ONE[0])
    assert result.statuses == (
        RolloutStatus.reached,
        RolloutStatus.stopped_elsewhere,
        RolloutStatus.stopped_elsewhere,
    )


def test_every_status_explains_itself_in_a_sentence():
    assert all(status.value.endswith(".") for status in RolloutStatus)
