"""The potential field: what its formula promises, checked on its true Jacobian for arbitrary parameters."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.func import jacrev, vmap
from torch.testing import assert_close

from geomotion.dynamics.certificate import Claim, certify
from geomotion.dynamics.charts import AnchoredChart
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.potential import PotentialField
from geomotion.dynamics.rollout import rollout
from geomotion.networks.coupling import CouplingFlow

MIN_RATE = 0.3
seeds = st.integers(0, 2**31 - 1)
dims = st.sampled_from([1, 2, 3, 8])


def random_field(seed: int, dim: int, scale: float = 1.0, units: int = 12) -> PotentialField:
    """A field with arbitrary parameters, in double precision."""
    torch.manual_seed(seed)
    field = PotentialField(dim, units, MIN_RATE, initial_rate=2.0).double()
    with torch.no_grad():
        for parameter in field.parameters():
            parameter.copy_(scale * torch.randn_like(parameter))
    return field


def jacobians(field: PotentialField, z: torch.Tensor) -> torch.Tensor:
    return vmap(jacrev(field))(z).detach()


def states(count: int, dim: int, spread: float = 3.0) -> torch.Tensor:
    return spread * torch.randn(count, dim, dtype=torch.float64)


# ---------------------------------------------------------------- for all parameters
@settings(deadline=None, max_examples=12)
@given(seed=seeds, dim=dims, scale=st.sampled_from([0.1, 1.0, 5.0]))
def test_the_symmetric_part_of_the_jacobian_is_at_most_minus_the_certified_rate(seed, dim, scale):
    field = random_field(seed, dim, scale)
    jacobian = jacobians(field, states(2000, dim))
    largest = torch.linalg.eigvalsh((jacobian + jacobian.mT) / 2).max()
    rounding = 1e-12 * jacobian.norm(dim=(-2, -1)).max()
    assert field.rate >= MIN_RATE - 1e-12
    assert largest <= -field.rate + rounding


@settings(deadline=None, max_examples=10)
@given(seed=seeds, dim=dims)
def test_the_certified_rate_is_reached_far_away_where_every_pull_is_saturated(seed, dim):
    field = random_field(seed, dim)
    jacobian = jacobians(field, states(2000, dim, 1e6))
    largest = torch.linalg.eigvalsh((jacobian + jacobian.mT) / 2).max()
    assert_close(float(largest), -field.rate, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("dim", [1, 2, 3, 8])
def test_trajectories_approach_each_other_at_least_at_the_rate(dim):
    field = random_field(dim, dim)
    times = torch.linspace(0, 1, 21, dtype=torch.float64)
    path = rollout(field, states(40, dim), times, method="rk4", substeps=10).states
    distance = (path[:20] - path[20:]).norm(dim=-1)
    assert (distance <= torch.exp(-field.rate * times) * distance[:, :1] * (1 + 1e-6) + 1e-9).all()


@settings(deadline=None, max_examples=25)
@given(seed=seeds, dim=dims)
def test_the_origin_is_exactly_at_rest(seed, dim):
    field = random_field(seed, dim)
    assert (field(torch.zeros(dim, dtype=torch.float64)) == 0).all()


@settings(deadline=None, max_examples=10)
@given(seed=seeds, dim=dims)
def test_it_is_a_gradient_but_for_the_same_rotation_everywhere(seed, dim):
    field = random_field(seed, dim)
    jacobian = jacobians(field, states(200, dim))
    root = field.linear.skew_root.detach()
    assert_close((jacobian - jacobian.mT) / 2, (root - root.T).expand_as(jacobian))


def test_it_is_minus_the_gradient_of_the_stated_potential():
    field = random_field(4, 3)
    z = states(50, 3).requires_grad_()
    matrix, pre = field.linear.matrix, z @ field.weight.T + field.bias
    quadratic = -(z @ matrix * z).sum(-1) / 2  # the skew part of A drops out
    pulls = field.gain * (torch.log(torch.cosh(pre)) - torch.tanh(field.bias) * (z @ field.weight.T))
    (gradient,) = torch.autograd.grad((quadratic + pulls.sum(-1)).sum(), z)
    assert_close(field(z), -gradient + z @ ((matrix - matrix.T) / 2).T)


# ---------------------------------------------------------------- use
def test_any_batch_shape_gives_the_same_velocities():
    field = random_field(1, 2)
    z = states(6, 2)
    assert_close(field(z.view(2, 3, 2)), field(z).view(2, 3, 2))
    assert_close(field(z[0]), field(z)[0])


def test_speed_need_not_fall_in_proportion_to_the_distance():
    field = PotentialField(1, 1, min_rate=0.1, initial_rate=0.2)
    with torch.no_grad():
        field.weight.fill_(10.0)
        field.bias.zero_()
        field.raw_gain.fill_(1.0)
    near, far = field(torch.tensor([[0.5], [1.0]])).abs()
    assert far < 1.05 * near


def test_a_rollout_knows_that_there_is_no_closed_form():
    field = random_field(2, 2)
    assert not ChartedField(AnchoredChart(flow(2), torch.zeros(2, dtype=torch.float64)), field, 1.0).is_solvable


# ---------------------------------------------------------------- in a chart
def flow(dim: int) -> CouplingFlow:
    """A flow far from the identity."""
    torch.manual_seed(0)
    chart = CouplingFlow(dim, 4, 16, [1.0], 1.0).double()
    with torch.no_grad():
        chart.weight.normal_(std=0.5)
    return chart.eval()


@pytest.mark.parametrize("dim", [2, 3])
def test_behind_a_flow_it_contracts_in_the_pulled_back_metric_at_the_rate_of_the_certificate(dim):
    anchor = torch.full((dim,), 0.3, dtype=torch.float64)
    model = ChartedField(AnchoredChart(flow(dim), anchor), random_field(7, dim), time_unit_s=2.5).double().eval()
    starts = states(40, dim, 1.0)
    times = torch.linspace(0, 3, 16, dtype=torch.float64)
    certificate = certify(model, starts)
    assert certificate.claim is Claim.by_construction
    assert certificate.rate_per_s >= MIN_RATE / 2.5

    path = model.chart.to_latent(rollout(model, starts, times, method="rk4", substeps=8).states).detach()
    distance = (path[:20] - path[20:]).norm(dim=-1)
    bound = torch.exp(-certificate.rate_per_s * times) * distance[:, :1]
    assert (distance <= bound * (1 + 1e-5) + 1e-7).all()
    assert_close(model(anchor).detach(), torch.zeros_like(anchor), rtol=0, atol=1e-12)
