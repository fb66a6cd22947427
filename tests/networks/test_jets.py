"""Networks and their derivatives, enclosed: random points of the boxes lie within the bounds, which tighten."""

import pytest
import torch
from torch import nn
from torch.func import hessian, jacrev, vmap

from geomotion.dynamics.balls import Ball
from geomotion.networks.jets import activation, enclose, pair_numbers
from geomotion.networks.mlp import MLP

ACTIVATIONS = {"tanh": nn.Tanh(), "sigmoid": nn.Sigmoid(), "softplus": nn.Softplus()}


@pytest.mark.parametrize("layer", ACTIVATIONS.values(), ids=ACTIVATIONS)
def test_activations_and_their_derivatives_stay_in_their_bounds(layer):
    torch.manual_seed(0)
    centre, radius = 3 * torch.randn(400, dtype=torch.float64), torch.rand(400, dtype=torch.float64)
    bounds = activation(layer, Ball(centre, radius))
    derivatives = [layer, vmap(jacrev(layer)), vmap(jacrev(jacrev(layer)))]
    for share in torch.linspace(-1, 1, 21, dtype=torch.float64):
        for bound, derivative in zip(bounds, derivatives, strict=True):
            assert ((derivative(centre + share * radius) - bound.mid).abs() <= bound.radius).all()
    assert all((bound.radius <= 0.5 * (1 + 2 * radius)).all() for bound in bounds)


def test_an_activation_with_kinks_has_no_bounds():
    with pytest.raises(TypeError, match="ReLU"):
        activation(nn.ReLU(), Ball.exact(torch.zeros(1, dtype=torch.float64)))


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("name", ACTIVATIONS)
def test_value_and_derivatives_of_a_network_stay_in_their_bounds(name, dim):
    torch.manual_seed(0)
    network = MLP(dim, 3, [12, 12], name).double()
    centre, radii = torch.randn(20, dim, dtype=torch.float64), 0.1 * torch.rand(20, dim, dtype=torch.float64)
    point, box = enclose(network, Ball.exact(centre), radii)
    order = pair_numbers(dim)
    for _ in range(20):
        x = centre + radii * (2 * torch.rand_like(radii) - 1)
        first, second = vmap(jacrev(network))(x), vmap(hessian(network))(x)
        assert ((network(x) - box.value.mid).abs() <= box.value.radius).all()
        assert ((first.mT - box.first.mid).abs() <= box.first.radius).all()
        for i in range(dim):
            for j in range(dim):
                bound = box.second[:, order[i, j]]
                assert ((second[:, :, i, j] - bound.mid).abs() <= bound.radius).all()
    assert (point.value.radius < 1e-13).all()
    assert (point.second.radius < 1e-12).all()


def test_bounds_on_first_derivatives_shrink_with_the_box_and_those_on_values_are_as_tight_as_the_slope_allows():
    torch.manual_seed(0)
    network = MLP(2, 3, [32, 32]).double().requires_grad_(False)
    centre = Ball.exact(torch.randn(50, 2, dtype=torch.float64))
    small, large = (enclose(network, centre, torch.full((50, 2), r).double())[1] for r in (1e-4, 2e-4))
    ratio = large.first.radius.mean() / small.first.radius.mean()
    assert 1.9 < float(ratio) < 2.2
    slopes = vmap(jacrev(network))(centre.mid).abs().sum(-1)
    assert (small.value.radius <= 1.1e-4 * slopes + 1e-6).all()
