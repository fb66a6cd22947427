"""Spline couplings: exact inverses and tangents, also beyond the range of the splines."""

import pytest
import torch
from torch.func import jvp
from torch.testing import assert_close

from geomotion.networks.rational_quadratic import carried, splines
from geomotion.networks.spline_flow import SplineFlow

BOUND = 10.0


def random_flow(dim: int) -> SplineFlow:
    torch.manual_seed(0)
    flow = SplineFlow(dim, layers=3, bins=10, bound=BOUND, blocks=2, units=30).double()
    with torch.no_grad():
        for parameter in flow.parameters():
            parameter.add_(0.1 * torch.randn_like(parameter))
    return flow


def states(*shape: int) -> torch.Tensor:
    """Some of them beyond the bound."""
    return 6 * torch.randn(*shape, generator=torch.Generator().manual_seed(1), dtype=torch.float64)


@pytest.mark.parametrize("dim", [2, 3, 6, 8])
@pytest.mark.parametrize("shape", [(), (40,), (2, 3)])
class TestEveryFlow:
    def test_the_inverse_is_exact(self, dim, shape):
        flow, x = random_flow(dim), states(*shape, dim)
        assert_close(flow.to_ambient(flow.to_latent(x)), x, rtol=1e-7, atol=1e-7)
        assert_close(flow.to_latent(flow.to_ambient(x)), x, rtol=1e-7, atol=1e-7)

    def test_carried_tangents_are_those_of_automatic_differentiation(self, dim, shape):
        flow, z, tangent = random_flow(dim), states(*shape, dim), states(*shape, dim)
        image, derivative = jvp(flow.to_ambient, (z,), (tangent,))
        found = flow.carry(z, tangent)
        assert_close(found[0], image)
        assert_close(found[1], derivative)

    def test_linearisation_is_that_of_the_inverse(self, dim, shape):
        flow, x, tangent = random_flow(dim), states(*shape, dim), states(*shape, dim)
        z, push_forward = flow.linearise(x)
        assert_close(z, flow.to_latent(x))
        assert_close(jvp(flow.to_latent, (x,), (push_forward(tangent),))[1], tangent, rtol=1e-6, atol=1e-6)


def test_a_new_flow_is_the_identity():
    x = states(50, 5)
    assert_close(SplineFlow(5, 3, 10, BOUND, 2, 30).double().to_latent(x), x)


def test_three_layers_reach_every_coordinate_from_each():
    flow = random_flow(6)
    jacobian = torch.func.jacrev(flow.to_ambient)(0.3 * states(6))
    assert (jacobian.abs() > 0).all()


def test_splines_carry_rates_of_parameters_and_arguments():
    parameters, rates = states(7, 2, 29) / 6, states(7, 2, 29) / 3
    x, x_rates = 3 * states(7, 2), states(7, 2)
    assert (x.abs() > BOUND).any()
    expected = jvp(lambda p, y: splines(p, 10, BOUND)(y), (parameters, x), (rates, x_rates))
    for found, wanted in zip(carried(parameters, rates, x, x_rates, 10, BOUND), expected, strict=True):
        assert_close(found, wanted)
