"""Gauss-Legendre quadrature against closed forms."""

import math
from itertools import pairwise

import pytest
import torch
from torch.testing import assert_close

from geomotion.dynamics.quadrature import GaussLegendre


def _integral(function, count: int) -> float:
    rule = GaussLegendre(count).double()
    return float(rule(lambda t: function(t)[:, None], torch.zeros(1, dtype=torch.float64)))


@pytest.mark.parametrize("count", [1, 2, 5, 10, 40])
def test_nodes_lie_inside_the_interval_and_weights_sum_to_one(count):
    rule = GaussLegendre(count).double()
    assert ((rule.nodes > 0) & (rule.nodes < 1)).all()
    assert (rule.weights > 0).all()
    assert_close(rule.weights.sum(), torch.tensor(1.0, dtype=torch.float64))


@pytest.mark.parametrize("count", [1, 2, 3, 6])
def test_polynomials_up_to_degree_2n_minus_1_are_exact_and_the_next_one_is_not(count):
    for degree in range(2 * count):
        assert _integral(lambda t, k=degree: t**k, count) == pytest.approx(1 / (degree + 1), rel=1e-13)
    assert _integral(lambda t: t ** (2 * count), count) != pytest.approx(1 / (2 * count + 1), rel=1e-6)


def test_the_error_of_an_analytic_function_falls_geometrically():
    # 1 / (1 + 4 t²) has poles at ±i/2: the ellipse with foci 0 and 1 through them has ρ² ≈ 4.5 (measured 4.3 to 4.7).
    exact = math.atan(2) / 2
    errors = [abs(_integral(lambda t: 1 / (1 + 4 * t**2), count) - exact) for count in (4, 8, 12, 16)]
    focal_sum = abs(0.5j) + abs(1 - 0.5j)
    rate = (focal_sum + math.sqrt(focal_sum**2 - 1)) ** 2
    for coarse, fine in pairwise(errors):
        assert math.log(coarse / fine) / 4 == pytest.approx(math.log(rate), rel=0.25)


@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
def test_integrals_are_taken_along_the_node_axis_of_any_batch(batch):
    scale = torch.randn(*batch, 1, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    start = torch.ones(*batch, 2, dtype=torch.float64)
    result = GaussLegendre(3).double()(lambda t: scale * t[:, None] ** 2, start)
    assert_close(result, 1 + scale.squeeze(-2) / 3)


def test_casting_to_single_and_back_keeps_the_nodes_of_double_precision():
    assert_close(GaussLegendre(7).float().double().nodes, GaussLegendre(7).double().nodes, rtol=0, atol=0)


def test_gradients_flow_through_the_integrand():
    rate = torch.tensor([0.7], dtype=torch.float64, requires_grad=True)
    GaussLegendre(12).double()(lambda t: torch.exp(rate * t[:, None]), torch.zeros_like(rate)).backward()
    a = 0.7
    assert rate.grad.item() == pytest.approx((math.exp(a) * (a - 1) + 1) / a**2, rel=1e-12)
