"""Likelihood of transitions, and what fields take from the demonstrations before they are trained."""

import pytest
import torch
from torch.func import jacrev
from torch.testing import assert_close

from geomotion.baselines.imitation_flow import StochasticDrift
from geomotion.config import LikelihoodTraining
from geomotion.dynamics.charts import IdentityChart, ScalingChart
from geomotion.dynamics.fields import ChartedField
from geomotion.networks.coupling import CouplingFlow
from geomotion.training.data import Geometry, TrainingSet
from geomotion.training.likelihood import TransitionLikelihood, log_volume
from geomotion.training.start import start_from_data
from geomotion.training.trainer import Schedule, fit

MATRIX = torch.tensor([[-2.0, 1.5], [-1.5, -1.0]])


def linear_data() -> TrainingSet:
    """Trajectories of ẋ = M x, two seconds each."""
    times = torch.linspace(0, 2, 100)
    starts = torch.tensor([[1.0, 0.0], [0.0, 1.0], [-1.0, 1.0]])
    flows = torch.linalg.matrix_exp(times[:, None, None] * MATRIX)
    states = tuple((flows @ start[:, None])[..., 0] for start in starts)
    return TrainingSet((times,) * 3, states, tuple(one @ MATRIX.T for one in states))


def test_the_volume_of_a_chart_is_that_of_its_jacobian():
    torch.manual_seed(0)
    flow = CouplingFlow(3, 4, 16, [1.0], 1.0).double()
    with torch.no_grad():
        flow.weight.normal_(std=0.3)
    x = torch.randn(6, 3, dtype=torch.float64)
    expected = torch.stack([torch.linalg.slogdet(jacrev(flow.to_latent)(one)).logabsdet for one in x])
    assert_close(log_volume(*flow.linearise(x)), expected)


def test_likelihood_does_not_depend_on_the_unit_of_the_chart():
    data = linear_data()
    objective = TransitionLikelihood(data, Geometry.of(data), LikelihoodTraining(batch_points=50))
    losses = []
    for scale in (1.0, 4.0):
        drift = StochasticDrift(2, False, 0.1 / scale)
        model = ChartedField(ScalingChart(torch.zeros(2), scale), drift, 2.0)
        losses.append(objective(model, 0.0, torch.Generator().manual_seed(1))["negative_log_likelihood"])
    assert_close(*losses)


def test_the_likeliest_drift_is_the_one_that_was_shown(tmp_path):
    data = linear_data()
    geometry = Geometry.of(data)
    model = ChartedField(IdentityChart(2), StochasticDrift(2, False, 0.3), geometry.duration_s)
    objective = TransitionLikelihood(data, geometry, LikelihoodTraining(batch_points=64, longest_step=0.1))
    schedule = Schedule(400, 0.1, 20, 10.0, 1000, 1000, 0)
    fit(model, objective, schedule, tmp_path / "checkpoint", lambda step, losses: None)
    assert_close(model.field.matrix.detach(), geometry.duration_s * MATRIX, atol=0.1, rtol=0)


class Listener(torch.nn.Module):
    """Remembers what it is started from."""

    dim = 2

    def forward(self, z):
        return z

    def start_from(self, times, states, velocities):
        self.heard = times, states, velocities


@pytest.mark.parametrize("scale", [1.0, 0.1])
def test_a_field_starts_from_demonstrations_in_its_own_units(scale):
    data, listener = linear_data(), Listener()
    model = ChartedField(ScalingChart(torch.ones(2), scale), listener, time_unit_s=2.0)
    assert start_from_data(model, data)
    times, states, velocities = listener.heard
    assert_close(times[0], data.times[0] / 2)
    assert_close(states[1], (data.states[1] - 1) / scale)
    assert_close(velocities[1], data.velocities[1] * 2 / scale)
    assert not start_from_data(ChartedField(IdentityChart(2), StochasticDrift(2, False, 0.1), 1.0), data)
