"""Bounds on the true Jacobian of line-integral fields contain it, by automatic differentiation, all over the cells."""

import pytest
import torch
from torch import nn

from geomotion.dynamics.line_integral import LineIntegralField, RungeKutta4
from geomotion.dynamics.quadrature import GaussLegendre
from geomotion.dynamics.regularisers import (
    ConstantRegulariser,
    EigenvalueRegulariser,
    StateDependentRegulariser,
    StateIndependentRegulariser,
)
from geomotion.networks.line_integral_bounds import LineIntegralBounds, why_unbounded
from geomotion.networks.mlp import MLP, JacobianRoot, SkewMatrix
from geomotion.scores.jacobians import field_jacobian


def regularisers(dim: int) -> dict[str, nn.Module]:
    return {
        "constant": ConstantRegulariser(0.2, dim),
        "eigenvalue": EigenvalueRegulariser(0.2, dim, 1.0, 1.0),
        "state_independent": StateIndependentRegulariser(0.2, dim, 1.0, 1.0),
        "state_dependent": StateDependentRegulariser(MLP(dim, dim, [8]), 1.0, 1.0),
    }


def field(dim: int, regulariser: str = "constant", skew: bool = False, activation: str = "tanh") -> LineIntegralField:
    torch.manual_seed(0)
    return LineIntegralField(
        JacobianRoot(dim, [10, 10], activation),
        regularisers(dim)[regulariser],
        nn.Parameter(0.3 * torch.randn(dim)),
        nn.Parameter(torch.randn(dim)),
        GaussLegendre(6),
        SkewMatrix(dim, [10], activation) if skew else None,
    )


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("regulariser", regularisers(1))
def test_the_jacobian_is_enclosed_in_every_cell(regulariser, dim):
    integral = field(dim, regulariser, skew=dim > 1)
    centres, radii = torch.randn(30, dim).double(), 0.1 * torch.rand(30, dim).double()
    bounds = LineIntegralBounds(integral)(centres, radii)
    exact = integral.double()
    error = (field_jacobian(exact, centres) - bounds.at_centre.mid).abs()
    assert (error <= bounds.at_centre.radius + 1e-14).all()
    assert (bounds.at_centre.radius < 1e-12).all()
    for _ in range(20):
        step = radii * (2 * torch.rand_like(radii) - 1)
        change = field_jacobian(exact, centres + step) - field_jacobian(exact, centres)
        expected = (bounds.slope.mid * step[..., None, None]).sum(1)
        allowed = (bounds.slope.radius * step.abs()[..., None, None]).sum(1)
        assert ((change - expected).abs() <= allowed + 1e-13).all()


def test_what_is_unknown_about_the_slopes_shrinks_with_the_cell():
    bounds = LineIntegralBounds(field(2, skew=True))
    centres = torch.randn(30, 2).double()
    small, large = (bounds(centres, torch.full_like(centres, r)).slope.radius.mean() for r in (1e-4, 2e-4))
    assert 1.9 < float(large / small) < 2.2


def field_of_function(known: LineIntegralField) -> LineIntegralField:
    """The same parts around a matrix that is no network."""
    parts = known.regulariser, known.base_point, known.base_velocity, known.integrator
    return LineIntegralField(lambda x: torch.diag_embed(x), *parts)


def test_reasons_are_given_for_fields_without_bounds():
    known = field(2)
    stepped = LineIntegralField(
        known.jacobian_root, known.regulariser, known.base_point, known.base_velocity, RungeKutta4(10)
    )
    assert "quadrature" in why_unbounded(stepped)
    assert "perceptrons" in why_unbounded(field_of_function(known))
    assert "relu" in why_unbounded(field(2, activation="relu")).lower()
    assert "line_integral" in why_unbounded(nn.Linear(2, 2))
    assert why_unbounded(field(2, "state_dependent", skew=True)) == ""
