"""Fields in a flow's coordinates: what each of them holds for all parameters, and what it does not."""

import math

import pytest
import torch
from torch.func import jacrev
from torch.testing import assert_close

from geomotion.baselines.elcd import ExtendedLinearField
from geomotion.baselines.euclideanizing_flow import NaturalDescent
from geomotion.baselines.imitation_flow import StochasticDrift
from geomotion.dynamics.certificate import Claim, certify
from geomotion.dynamics.fields import ChartedField
from geomotion.networks.coupling import CouplingFlow
from geomotion.scores.jacobians import field_jacobian, symmetric_eigenvalues

POINTS = torch.randn(100, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(0))


def bent(seed: int = 0) -> CouplingFlow:
    """A flow that is not the identity."""
    torch.manual_seed(seed)
    flow = CouplingFlow(2, 4, 16, [1.0], 1.0).double()
    with torch.no_grad():
        flow.weight.normal_(std=0.3)
    return flow


@pytest.mark.parametrize("seed", range(3))
def test_elcd_comes_to_the_goal_at_its_rate_whatever_the_parameters(seed):
    torch.manual_seed(seed)
    field = ExtendedLinearField(2, [16], "tanh", 0.2).double()
    z = 3 * POINTS
    assert ((z * field(z)).sum(-1) <= -0.2 * z.square().sum(-1) + 1e-9).all()
    assert (symmetric_eigenvalues(field.matrix(z)) <= -0.2 + 1e-9).all()


def test_elcds_matrix_is_not_its_jacobian_which_need_not_contract():
    torch.manual_seed(0)
    field = ExtendedLinearField(2, [16], "tanh", 0.2).double()
    with torch.no_grad():
        for parameter in field.parameters():
            parameter.mul_(3)
    assert symmetric_eigenvalues(field_jacobian(field, POINTS)).max() > 0


def test_natural_descent_is_that_of_the_distance_in_the_flows_coordinates():
    flow = bent()
    field = NaturalDescent(2, [8], "silu").double()
    x = POINTS + 3  # away from the goal, next to which the descent slows down
    found = ChartedField(flow, field, time_unit_s=1.0)(x)
    for state, velocity in zip(x[:5], found, strict=False):
        jacobian = jacrev(flow.to_latent)(state)
        gradient = jacrev(lambda one: flow.to_latent(one).norm())(state)
        descent = -torch.linalg.solve(jacobian.T @ jacobian, gradient)
        speed = field.log_speed(flow.to_latent(state)).exp()
        assert_close(velocity, speed * descent, rtol=1e-4, atol=1e-8)


def test_natural_descent_has_a_limit_at_the_goal():
    field = NaturalDescent(2, [8], "silu").double()
    assert_close(field(torch.zeros(2, dtype=torch.float64)), torch.zeros(2, dtype=torch.float64))
    assert symmetric_eigenvalues(field_jacobian(field, torch.zeros(1, 2, dtype=torch.float64))).max() < 0


@pytest.mark.parametrize("is_saturated", [False, True])
def test_short_transitions_are_those_of_the_drift_with_noise(is_saturated):
    field = StochasticDrift(2, is_saturated, 0.3).double()
    z, later, duration = POINTS[:20], POINTS[20:40], torch.full((20,), 1e-3, dtype=torch.float64)
    mean = z + 1e-3 * field(z)
    expected = torch.distributions.Normal(mean, 0.3 * math.sqrt(1e-3)).log_prob(later).sum(-1)
    assert_close(field.log_transition(z, later, duration), expected, rtol=1e-3, atol=0)


def test_long_transitions_of_a_linear_drift_have_the_exact_mean():
    field = StochasticDrift(2, False, 0.3).double()
    with torch.no_grad():
        field.matrix.copy_(torch.tensor([[-1.0, 3.0], [-3.0, -0.5]]))
    z = POINTS[:1]
    mean = z @ torch.linalg.matrix_exp(0.7 * field.matrix).T
    best = field.log_transition(z, mean, torch.tensor([0.7], dtype=torch.float64))
    assert_close(
        best, torch.tensor([-2 * math.log(0.3 * math.sqrt(0.7) * math.sqrt(2 * math.pi))], dtype=torch.float64)
    )


@pytest.mark.parametrize(
    ("field", "words"),
    [
        (ExtendedLinearField(2, [4], "tanh", 0.1), "ELCD claims"),
        (NaturalDescent(2, [4], "silu"), "Contraction is not claimed"),
        (StochasticDrift(2, False, 0.1), "its largest eigenvalue is -4.61 per duration"),
        (StochasticDrift(2, True, 0.1), "Where the drift saturates"),
    ],
)
def test_certificates_say_what_the_method_claims_and_that_contraction_is_measured(field, words):
    certificate = certify(ChartedField(bent().float(), field, 1.0), POINTS.float())
    assert certificate.claim is Claim.measured_only
    assert certificate.rate_per_s is None
    assert words in certificate.reason
