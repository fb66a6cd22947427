"""ε of Eq. (5.1), (5.4) and its loss, Eq. (5.5)."""

import pytest
import torch
from torch.testing import assert_close

from geomotion.dynamics.regularisers import ConstantRegulariser, StateIndependentRegulariser


def _learned(dim: int = 3, spread_weight: float = 0.5, spread_limit: float = 10.0) -> StateIndependentRegulariser:
    return StateIndependentRegulariser(0.01, dim, spread_weight, spread_limit).double()


def test_constant_epsilon_is_what_was_given_and_costs_nothing():
    regulariser = ConstantRegulariser(0.25, 3)
    assert_close(regulariser(torch.randn(5, 3)), torch.full((3,), 0.25))
    assert regulariser.loss() == 0
    assert not list(regulariser.parameters())


@pytest.mark.parametrize("root", [0.0, -0.3, 1e-12, 40.0])
def test_learned_epsilon_is_positive_for_every_parameter(root):
    regulariser = _learned()
    with torch.no_grad():
        regulariser.epsilon_root.fill_(root)
    assert (regulariser.epsilon > 0).all()
    assert_close(regulariser.epsilon, torch.full((3,), root**2 + 1e-10, dtype=torch.float64))


def test_training_starts_at_the_given_epsilon_with_entries_that_differ():
    epsilon = _learned().epsilon.detach()
    assert epsilon[0].item() == pytest.approx(0.01, rel=1e-6)
    assert len(set(epsilon.tolist())) == 3


def test_the_loss_is_the_weighted_squared_difference_to_the_first_entry():
    regulariser = _learned()
    with torch.no_grad():
        regulariser.epsilon_root.copy_(torch.tensor([1.0, 2.0, 0.0]))
    assert regulariser.loss().item() == pytest.approx(-0.5 * (3**2 + 1**2))


def test_minimising_the_loss_pushes_entries_apart_from_the_start():
    regulariser = _learned()
    regulariser.loss().backward()
    downhill = -regulariser.epsilon_root.grad
    assert downhill[0] < 0 < downhill[1:].min()


def test_the_loss_is_bounded_below_and_stops_pushing_at_the_limit():
    regulariser = _learned(spread_limit=2.0)
    with torch.no_grad():
        regulariser.epsilon_root.copy_(torch.tensor([0.1, 1e3, 1e6]))
    regulariser.loss().backward()
    assert regulariser.loss().item() == pytest.approx(-0.5 * 2 * 2.0**2)
    assert_close(regulariser.epsilon_root.grad, torch.zeros(3, dtype=torch.float64))


def test_descending_on_the_loss_alone_ends_near_the_limit():
    regulariser = _learned(dim=2, spread_weight=1.0, spread_limit=0.5)
    optimiser = torch.optim.Adam(regulariser.parameters(), lr=0.01)
    for _ in range(300):
        optimiser.zero_grad()
        regulariser.loss().backward()
        optimiser.step()
    assert 0.5 <= (regulariser.epsilon[1] - regulariser.epsilon[0]).item() < 0.8


def test_one_dimension_has_nothing_to_spread():
    regulariser = _learned(dim=1)
    regulariser.loss().backward()
    assert regulariser.loss() == 0
