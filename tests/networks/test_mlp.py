"""The networks behind the Jacobian of the line-integral field."""

import pytest
import torch
from torch.testing import assert_close

from geomotion.errors import UnknownName
from geomotion.networks.mlp import ACTIVATIONS, MLP, JacobianRoot, SkewMatrix


@pytest.mark.parametrize("activation", sorted(ACTIVATIONS))
def test_one_hidden_layer_is_the_formula(activation):
    torch.manual_seed(0)
    network = MLP(3, 2, [7], activation).double()
    x = torch.randn(5, 3, dtype=torch.float64)
    smooth = {"softplus": lambda y: (1 + y.exp()).log(), "silu": lambda y: y * torch.sigmoid(y)}
    kinked = {"relu": lambda y: y.clamp(min=0), "elu": lambda y: torch.where(y > 0, y, y.exp() - 1)}
    function = {"tanh": torch.tanh, "sigmoid": torch.sigmoid, **smooth, **kinked}[activation]
    first, last = network[0], network[2]
    assert_close(network(x), function(x @ first.weight.T + first.bias) @ last.weight.T + last.bias)


def test_hidden_widths_are_those_asked_for():
    shapes = [tuple(layer.weight.shape) for layer in MLP(2, 4, [50, 30]) if isinstance(layer, torch.nn.Linear)]
    assert shapes == [(50, 2), (30, 50), (4, 30)]


def test_an_unknown_activation_is_refused_by_name():
    with pytest.raises(UnknownName, match="Did you mean 'tanh'"):
        MLP(2, 2, [4], "tan")


@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
def test_jacobian_root_is_a_square_matrix_for_any_batch(batch):
    torch.manual_seed(0)
    root = JacobianRoot(3, [8])
    x = torch.randn(*batch, 3)
    assert root(x).shape == (*batch, 3, 3)
    assert_close(root(x).flatten(-2), root.network(x))


def test_a_network_starts_at_a_constant_and_can_leave_it():
    network, constant = MLP(3, 2, [7]), torch.tensor([0.5, -1.0])
    network.start_at(constant)
    assert_close(network(torch.randn(4, 3)), constant.expand(4, 2))
    network(torch.randn(4, 3)).sum().backward()
    assert network[-1].weight.grad.abs().min() > 0


@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
@pytest.mark.parametrize("dim", [2, 3, 6])
def test_skew_matrix_is_skew_symmetric_with_one_output_for_each_pair_of_axes(dim, batch):
    torch.manual_seed(0)
    network, x = SkewMatrix(dim, [8]), torch.randn(*batch, dim)
    matrix = network(x)
    assert matrix.shape == (*batch, dim, dim)
    assert_close(matrix, -matrix.mT)
    below = matrix[..., *torch.tril_indices(dim, dim, -1)]
    assert_close(below, network.network(x))


def test_skew_matrix_in_three_dimensions_has_the_pattern_of_the_thesis():
    network = SkewMatrix(3, [4])
    network.network.start_at(torch.tensor([1.0, -2.0, 3.0]))  # J_0, -J_1 and J_2 of Eq. (5.8)
    expected = torch.tensor([[0.0, -1.0, 2.0], [1.0, 0.0, -3.0], [-2.0, 3.0, 0.0]])
    assert_close(network(torch.randn(3)), expected)
