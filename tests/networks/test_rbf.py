"""Radial basis networks: positive everywhere, at a floor far away, differentiable both ways."""

import pytest
import torch
from torch.func import jacfwd, jacrev, vmap
from torch.testing import assert_close

from geomotion.networks.rbf import RadialBasisNetwork

FLOOR, LEVEL, BANDWIDTH = 0.01, 30.0, 0.2


def points(count: int, dim: int = 2, seed: int = 0) -> torch.Tensor:
    return torch.randn(count, dim, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))


def network(kernels: int = 20, dim: int = 2) -> RadialBasisNetwork:
    found = RadialBasisNetwork(kernels, dim, FLOOR).double()
    found.place(points(kernels, dim), BANDWIDTH, LEVEL)
    return found


@pytest.mark.parametrize("dim", [2, 3])
def test_it_is_the_formula(dim):
    precision, z = network(dim=dim), points(7, dim, seed=1)
    with torch.no_grad():
        precision.log_weights.copy_(torch.linspace(-2, 2, 20))
    squares = (z[:, None] - precision.centres).square().sum(dim=-1)
    expected = (precision.log_weights.exp() * (-squares / (2 * BANDWIDTH**2)).exp()).sum(dim=-1) + FLOOR
    assert_close(precision(z), expected)


def test_it_starts_at_the_wanted_level_where_its_kernels_are():
    precision = network()
    assert_close((precision(precision.centres) - FLOOR).mean(), torch.tensor(LEVEL).double())
    assert precision.log_weights.unique().numel() == 1


def test_it_is_positive_and_falls_to_its_floor_far_from_all_kernels():
    precision = network()
    with torch.no_grad():
        precision.log_weights.copy_(torch.linspace(-40, 5, 20))
    assert (precision(3 * points(1000, seed=2)) >= FLOOR).all()
    assert_close(precision(1e3 * points(10, seed=3)), torch.full((10,), FLOOR).double())


@pytest.mark.parametrize("at_kernels", [False, True])
def test_derivatives_in_both_modes_agree_with_finite_differences(at_kernels):
    precision = network()
    z = precision.centres[:5] if at_kernels else points(5, seed=1)
    forward, reverse = vmap(jacfwd(precision))(z), vmap(jacrev(precision))(z)
    assert_close(forward, reverse)
    steps = 1e-6 * torch.eye(2).double()
    differences = torch.stack([(precision(z + step) - precision(z - step)) / 2e-6 for step in steps], dim=-1)
    assert_close(forward, differences, atol=1e-6, rtol=1e-6)


@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
def test_any_batch_is_taken_and_kernels_travel_with_the_parameters(batch):
    precision, other = network(), RadialBasisNetwork(20, 2, FLOOR).double()
    other.load_state_dict(precision.state_dict())
    z = points(6, seed=1)[: max(1, len(batch) and torch.Size(batch).numel())].reshape(*batch, 2)
    assert precision(z).shape == batch
    assert_close(other(z), precision(z), rtol=0, atol=0)
