"""Fields without a promise: closed forms, and what they have in common with the thesis' field."""

import pytest
import torch
from torch import nn
from torch.testing import assert_close

from geomotion.baselines.unconstrained import UnconstrainedLineIntegral
from geomotion.baselines.velocity_network import VelocityNetwork
from geomotion.dynamics.certificate import Claim, certify
from geomotion.dynamics.charts import IdentityChart
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.line_integral import LineIntegralField
from geomotion.dynamics.quadrature import GaussLegendre
from geomotion.dynamics.regularisers import ConstantRegulariser
from geomotion.networks.mlp import JacobianRoot
from geomotion.scores.jacobians import field_jacobian

BATCHES = [(), (3,), (2, 3)]
BASE, VELOCITY = torch.tensor([0.3, -0.2]), torch.tensor([0.1, 0.4])


class Constant(nn.Module):
    """The same matrix everywhere."""

    def __init__(self, matrix: torch.Tensor) -> None:
        super().__init__()
        self.matrix = matrix

    def forward(self, x):
        return self.matrix.expand(*x.shape, x.shape[-1])


@pytest.mark.parametrize("batch", BATCHES)
def test_a_constant_matrix_gives_a_linear_field_with_that_jacobian_whatever_its_signs(batch):
    matrix = torch.tensor([[2.0, -1.0], [0.5, 1.0]])
    field = UnconstrainedLineIntegral(Constant(matrix), BASE, VELOCITY, GaussLegendre(3))
    x = torch.randn(*batch, 2)
    assert_close(field(x), VELOCITY + (x - BASE) @ matrix.T)
    assert_close(field_jacobian(field, x.reshape(-1, 2))[0], matrix)


def test_it_is_the_field_of_the_thesis_where_the_matrix_is_that_of_the_thesis():
    torch.manual_seed(0)
    constrained = LineIntegralField(
        JacobianRoot(2, [16]), ConstantRegulariser(0.1, 2), BASE, VELOCITY, GaussLegendre(10)
    ).double()
    free = UnconstrainedLineIntegral(constrained.contraction_jacobian, BASE, VELOCITY, GaussLegendre(10)).double()
    x = torch.randn(20, 2, dtype=torch.float64)
    assert_close(free(x), constrained(x))


def test_the_base_is_learned_only_where_it_is_a_parameter():
    def names(point, velocity):
        field = UnconstrainedLineIntegral(Constant(torch.eye(2)), point, velocity, GaussLegendre(3))
        return {name for name, _ in field.named_parameters()}

    assert names(BASE, nn.Parameter(VELOCITY)) == {"base_velocity"}
    assert names(nn.Parameter(BASE), VELOCITY) == {"base_point"}


@pytest.mark.parametrize("batch", BATCHES)
def test_a_velocity_network_keeps_the_shape_of_its_states(batch):
    field = VelocityNetwork(3, [8, 8], "relu")
    x = torch.randn(*batch, 3)
    assert field(x).shape == x.shape
    assert_close(field(x.reshape(-1, 3)).reshape(x.shape), field(x))


@pytest.mark.parametrize(
    "field",
    [
        VelocityNetwork(2, [8], "tanh"),
        UnconstrainedLineIntegral(Constant(-torch.eye(2)), BASE, VELOCITY, GaussLegendre(3)),
    ],
    ids=["network", "line integral"],
)
def test_nothing_is_claimed_about_them(field):
    certificate = certify(ChartedField(IdentityChart(2), field, 1.0), torch.randn(5, 2))
    assert (certificate.claim, certificate.rate_per_s) == (Claim.measured_only, None)
    assert "Nothing in this network" in certificate.reason
