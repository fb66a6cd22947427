"""ε of Eq. (5.1), (5.4) and its losses, Eq. (5.5), (5.6)."""

import pytest
import torch
from torch.testing import assert_close

from geomotion.dynamics.regularisers import (
    ConstantRegulariser,
    EigenvalueRegulariser,
    StateDependentRegulariser,
    StateIndependentRegulariser,
    unequal_roots,
)
from geomotion.networks.mlp import MLP

STATES = torch.randn(6, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0))


def _learned(dim: int = 3, spread_weight: float = 0.5, spread_limit: float = 10.0) -> StateIndependentRegulariser:
    return StateIndependentRegulariser(0.01, dim, spread_weight, spread_limit).double()


def _network(dim: int = 3, spread_weight: float = 0.5, spread_limit: float = 10.0) -> StateDependentRegulariser:
    torch.manual_seed(0)
    root = MLP(dim, dim, [8])
    root.start_at(unequal_roots(0.01, dim))
    return StateDependentRegulariser(root, spread_weight, spread_limit).double()


def _disturbed(regulariser: StateDependentRegulariser, size: float = 1.0) -> StateDependentRegulariser:
    torch.manual_seed(1)
    with torch.no_grad():
        for parameter in regulariser.parameters():
            parameter += size * torch.randn_like(parameter)
    return regulariser


def _unused(x):
    raise AssertionError("this regulariser has no business with Ĵ")


# ---------------------------------------------------------------- constant
def test_constant_epsilon_is_what_was_given_and_costs_nothing():
    regulariser = ConstantRegulariser(0.25, 3)
    assert_close(regulariser(torch.randn(5, 3)), torch.full((3,), 0.25))
    assert regulariser.loss(STATES, _unused) == 0
    assert not list(regulariser.parameters())


# ---------------------------------------------------------------- a vector
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
    assert regulariser.loss(STATES, _unused).item() == pytest.approx(-0.5 * (3**2 + 1**2))


def test_minimising_the_loss_pushes_entries_apart_from_the_start():
    regulariser = _learned()
    regulariser.loss(STATES, _unused).backward()
    downhill = -regulariser.epsilon_root.grad
    assert downhill[0] < 0 < downhill[1:].min()


def test_the_loss_is_bounded_below_and_stops_pushing_at_the_limit():
    regulariser = _learned(spread_limit=2.0)
    with torch.no_grad():
        regulariser.epsilon_root.copy_(torch.tensor([0.1, 1e3, 1e6]))
    regulariser.loss(STATES, _unused).backward()
    assert regulariser.loss(STATES, _unused).item() == pytest.approx(-0.5 * 2 * 2.0**2)
    assert_close(regulariser.epsilon_root.grad, torch.zeros(3, dtype=torch.float64))


def test_descending_on_the_loss_alone_ends_near_the_limit():
    regulariser = _learned(dim=2, spread_weight=1.0, spread_limit=0.5)
    optimiser = torch.optim.Adam(regulariser.parameters(), lr=0.01)
    for _ in range(300):
        optimiser.zero_grad()
        regulariser.loss(STATES, _unused).backward()
        optimiser.step()
    assert 0.5 <= (regulariser.epsilon[1] - regulariser.epsilon[0]).item() < 0.8


def test_one_dimension_has_nothing_to_spread():
    regulariser = _learned(dim=1)
    regulariser.loss(STATES, _unused).backward()
    assert regulariser.loss(STATES, _unused) == 0


# ---------------------------------------------------------------- a network of the state
def test_a_network_starts_at_the_epsilon_of_the_vector_everywhere():
    regulariser = _network()
    expected = StateIndependentRegulariser(0.01, 3, 0.5, 10.0).double().epsilon
    assert_close(regulariser(STATES), expected.expand(6, 3))
    assert_close(regulariser.loss(STATES, _unused), _learned().loss(STATES, _unused))


@pytest.mark.parametrize("size", [1e-8, 1.0, 100.0])
def test_epsilon_of_a_network_is_positive_for_every_parameter_and_state(size):
    epsilon = _disturbed(_network(), size)(100 * STATES)
    assert (epsilon >= 1e-10).all()
    assert epsilon.std(0).min() > 0  # it does depend on the state


def test_the_loss_of_a_network_is_the_mean_over_the_states():
    regulariser = _disturbed(_network(), 0.5)
    epsilon = regulariser(STATES)
    assert (epsilon[:, :1] - epsilon[:, 1:]).abs().max() < 10.0
    expected = -0.5 * sum((one[0] - one[1]) ** 2 + (one[0] - one[2]) ** 2 for one in epsilon) / 6
    assert_close(regulariser.loss(STATES, _unused), expected)


def test_the_loss_of_a_network_is_bounded_below_and_moves_every_parameter():
    regulariser = _disturbed(_network(spread_limit=2.0), 0.5)
    regulariser.loss(STATES, _unused).backward()
    assert all(parameter.grad.abs().max() > 0 for parameter in regulariser.parameters())
    assert -0.5 * 2 * 2.0**2 <= _disturbed(regulariser, 1e3).loss(STATES, _unused).item() < 0


# ---------------------------------------------------------------- eigenvalues
def _of_eigenvalues(*eigenvalues: float) -> torch.Tensor:
    """One symmetric matrix with the given eigenvalues for each state, in another basis each."""
    basis = torch.linalg.qr(torch.randn(6, 3, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1)))[0]
    return basis @ torch.tensor(eigenvalues, dtype=torch.float64).diag() @ basis.mT


def _eigenvalue_regulariser(spread_limit: float = 10.0) -> EigenvalueRegulariser:
    return EigenvalueRegulariser(0.25, 3, 0.5, spread_limit).double()


def test_the_eigenvalue_loss_is_the_weighted_squared_difference_to_the_largest():
    matrix = _of_eigenvalues(-2.0, -1.0, -4.0)
    assert _eigenvalue_regulariser().loss(STATES, lambda x: matrix).item() == pytest.approx(-0.5 * (1 + 9))
    assert_close(_eigenvalue_regulariser()(STATES), torch.full((3,), 0.25, dtype=torch.float64))


def test_the_eigenvalue_loss_ignores_a_skew_part():
    matrix, skew = _of_eigenvalues(-2.0, -1.0, -4.0), torch.randn(6, 3, 3, dtype=torch.float64)
    with_skew = _eigenvalue_regulariser().loss(STATES, lambda x: matrix + skew - skew.mT)
    assert_close(with_skew, _eigenvalue_regulariser().loss(STATES, lambda x: matrix))


def test_the_eigenvalue_loss_vanishes_for_equal_eigenvalues_and_its_gradient_stays_finite():
    matrix = _of_eigenvalues(-3.0, -3.0, -3.0).requires_grad_()
    loss = _eigenvalue_regulariser().loss(STATES, lambda x: matrix)
    loss.backward()
    assert abs(loss.item()) < 1e-25
    assert matrix.grad.abs().max() < 1e-12


def test_the_eigenvalue_loss_is_bounded_below_and_stops_pushing_at_the_limit():
    matrix = _of_eigenvalues(-1.0, -1e3, -1e6).requires_grad_()
    loss = _eigenvalue_regulariser(spread_limit=2.0).loss(STATES, lambda x: matrix)
    loss.backward()
    assert loss.item() == pytest.approx(-0.5 * 2 * 2.0**2)
    assert_close(matrix.grad, torch.zeros_like(matrix))


def test_descending_on_the_eigenvalue_loss_pushes_them_apart():
    matrix = _of_eigenvalues(-1.0, -1.5, -2.5).requires_grad_()
    _eigenvalue_regulariser().loss(STATES, lambda x: matrix).backward()
    before, after = (torch.linalg.eigvalsh(one.detach()) for one in (matrix, matrix - 0.1 * matrix.grad))
    assert ((after[:, -1] - after[:, 0]) > (before[:, -1] - before[:, 0])).all()
