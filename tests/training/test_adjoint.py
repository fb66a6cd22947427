"""Fitting through a solver: demonstrations that the field draws itself are at distance 0, and gradients are right."""

import math
from dataclasses import replace

import pytest
import torch
from torch import nn
from torch.testing import assert_close

from geomotion.config import AdjointTraining
from geomotion.dynamics.charts import IdentityChart, ScalingChart
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.linear import LinearField
from geomotion.dynamics.time_law import SplineTimeLaw
from geomotion.training.adjoint import TrajectoryShooting
from geomotion.training.data import Geometry, TrainingSet

RATE_PER_S, DURATION_S, CENTRE, SCALE_M = 0.7, 2.0, torch.tensor([0.1, -0.2]), 0.5
TIGHT = {"relative_tolerance": 1e-7, "absolute_tolerance": 1e-7}


class Decay(nn.Module):
    """ż = -k z, per time unit."""

    dim = 2

    def __init__(self, rate: float) -> None:
        super().__init__()
        self.rate = nn.Parameter(torch.tensor(rate))

    def forward(self, z):
        return -self.rate * z


@pytest.fixture
def data() -> TrainingSet:
    """Exact solutions, with times that are not even."""
    times = [DURATION_S * torch.linspace(0, 1, 400) ** power for power in (1.0, 1.3)]
    starts = torch.tensor([[0.4, 0.1], [-0.3, 0.3]])
    states = [CENTRE + torch.exp(-RATE_PER_S * t)[:, None] * start for t, start in zip(times, starts, strict=True)]
    return TrainingSet(tuple(times), tuple(states), tuple(-RATE_PER_S * (x - CENTRE) for x in states))


def loss_of(rate_per_s: float, data: TrainingSet, **settings) -> tuple[torch.Tensor, ChartedField]:
    model = ChartedField(ScalingChart(CENTRE, SCALE_M), Decay(rate_per_s * DURATION_S), DURATION_S)
    objective = TrajectoryShooting(data, Geometry.of(data), AdjointTraining(**{**TIGHT, **settings}))
    losses = objective(model, 0.0, torch.Generator().manual_seed(0))
    return losses["trajectory"], model


def test_the_field_that_drew_the_demonstrations_has_no_loss(data):
    right, _ = loss_of(RATE_PER_S, data)
    wrong, _ = loss_of(2 * RATE_PER_S, data)
    assert right < 1e-8 < 1e-4 < wrong


def test_the_adjoint_gradient_is_that_of_the_closed_form(data):
    loss, model = loss_of(1.0, data)
    loss.backward()
    step = 1e-2
    difference = (loss_of(1.0 + step, data)[0] - loss_of(1.0 - step, data)[0]) / (2 * step * DURATION_S)
    assert_close(model.field.rate.grad, difference.detach(), rtol=1e-2, atol=0)


def test_a_time_law_counts_from_the_start_of_the_demonstration_and_is_fitted_as_well(data):
    law = SplineTimeLaw(4, 0.2)
    with torch.no_grad():
        law.raw_speeds.copy_(torch.tensor([-1.0, 1.0, 2.0, 0.0, -2.0]))
    model = ChartedField(ScalingChart(CENTRE, SCALE_M), LinearField(2, 0.5, 1.0), DURATION_S, law)
    states = [model.solve(x[:1], t)[0].detach() for x, t in zip(data.states, data.times, strict=True)]
    drawn = replace(data, states=tuple(states))
    objective = TrajectoryShooting(drawn, Geometry.of(drawn), AdjointTraining(**TIGHT, piece=0.3))

    def loss() -> torch.Tensor:
        return objective(model, 0.0, torch.Generator().manual_seed(0))["trajectory"]

    assert loss() < 1e-8
    with torch.no_grad():
        law.raw_speeds.add_(torch.tensor([0.0, 0.3, 0.0, 0.0, 0.0]))
    loss().backward()
    found, step = law.raw_speeds.grad[1].clone(), 1e-2
    with torch.no_grad():
        law.raw_speeds[1] += step
        above = loss()
        law.raw_speeds[1] -= 2 * step
    assert_close(found, (above - loss()).detach() / (2 * step), rtol=2e-2, atol=0)


def test_pieces_are_no_longer_than_the_shortest_demonstration(data):
    short = TrainingSet((data.times[0], data.times[1][:100]), (data.states[0], data.states[1][:100]), data.velocities)
    objective = TrajectoryShooting(short, Geometry.of(data), AdjointTraining(piece=1.0))
    assert objective.duration_s == pytest.approx(float(short.times[1][-1]))


def test_a_solver_that_gives_up_is_a_loss_that_is_no_number(data):
    class Steep(Decay):
        def forward(self, z):
            return self.rate * torch.sin(1e6 * z)

    model = ChartedField(IdentityChart(2), Steep(1e3), DURATION_S)
    objective = TrajectoryShooting(data, Geometry.of(data), AdjointTraining(most_solver_steps=3))
    assert math.isnan(objective(model, 0.0, torch.Generator().manual_seed(0))["trajectory"])
