"""The network behind the Jacobian of the line-integral field."""

import pytest
import torch
from torch.testing import assert_close

from geomotion.errors import UnknownName
from geomotion.networks.mlp import ACTIVATIONS, MLP, JacobianRoot


@pytest.mark.parametrize("activation", sorted(ACTIVATIONS))
def test_one_hidden_layer_is_the_formula(activation):
    torch.manual_seed(0)
    network = MLP(3, 2, [7], activation).double()
    x = torch.randn(5, 3, dtype=torch.float64)
    function = {"tanh": torch.tanh, "softplus": torch.nn.functional.softplus, "sigmoid": torch.sigmoid}[activation]
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
