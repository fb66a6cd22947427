"""Bisection on fields whose Jacobian is a polynomial, so that the right shares are known."""

import numpy as np
import pytest
import torch

from geomotion.dynamics.balls import Ball
from geomotion.scores.grids import Box
from geomotion.scores.verification import JacobianEnclosure, first_cells, verify_contraction

BOX = Box(np.array([-1.0, -1.0]), np.array([1.0, 1.0]))


def paraboloid(offset: float):
    """∂f/∂x = diag(x² + y² - offset, -1 - offset), its derivatives enclosed over cells."""

    def bounds(centres, radii):
        other = torch.full_like(centres[:, 0], -1.0 - offset)
        matrix = torch.stack([centres.square().sum(-1) - offset, other], -1).diag_embed()
        middle, spread = torch.zeros(2, len(centres), 2, 2, 2, dtype=torch.float64)
        middle[:, :, 0, 0], spread[:, :, 0, 0] = 2 * centres, 2 * radii
        return JacobianEnclosure(Ball.exact(matrix), Ball(middle, spread))

    return bounds


def test_a_field_that_contracts_everywhere_is_verified_at_a_rate_that_holds():
    found = verify_contraction(paraboloid(2.5), BOX, budget=400)
    assert found.contracting == 1.0
    assert found.undecided == found.not_contracting == 0.0
    assert 0.25 < found.rate <= 0.5  # at the corners, λ_max = -0.5
    assert found.witness is None
    assert found.witness_eigenvalue is None


def test_shares_approach_those_of_the_volume_and_a_witness_is_shown():
    found = verify_contraction(paraboloid(0.5), BOX, budget=15000)
    disc = np.pi * 0.5 / 4  # x² + y² < 0.5
    assert disc - 0.05 < found.contracting <= disc
    assert 1 - disc - 0.05 < found.not_contracting <= 1 - disc
    assert found.contracting + found.not_contracting + found.undecided == pytest.approx(1.0)
    assert found.rate is None
    assert float(found.witness @ found.witness) - 0.5 == pytest.approx(found.witness_eigenvalue, abs=1e-9)
    assert found.witness_eigenvalue > 1.0


def test_a_small_budget_leaves_more_undecided_and_never_says_something_else():
    shares = [verify_contraction(paraboloid(0.5), BOX, budget) for budget in (30, 500, 5000)]
    assert shares[0].cells == 30
    assert 1000 <= shares[2].cells < 1100  # a fifth of the budget, once there is a witness
    assert shares[0].undecided > shares[1].undecided > shares[2].undecided
    assert all(one.contracting <= np.pi / 8 for one in shares)


def test_a_maximum_on_the_edge_of_contraction_stays_undecided():
    found = verify_contraction(paraboloid(2.0), BOX, budget=2000)
    assert found.rate is None
    assert 0 < found.undecided < 0.01


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_cells_tile_the_box_with_a_little_overlap_and_halves_tile_their_cell(dim):
    box = Box(-np.arange(1.0, dim + 1), np.full(dim, 2.0))
    cells = first_cells(box)
    assert float(cells.shares.sum()) == pytest.approx(1.0)
    halves = cells.halved(torch.zeros(len(cells.shares), dtype=torch.long)).halved(
        torch.full((2 * len(cells.shares),), dim - 1)
    )
    assert float(halves.shares.sum()) == pytest.approx(1.0)
    x = torch.from_numpy(np.random.default_rng(0).uniform(box.lower, box.upper, (500, dim)))
    for some in (cells, halves):
        inside = ((x[:, None] - some.centres).abs() <= some.radii).all(-1)
        assert inside.any(-1).all()
        np.testing.assert_allclose((2 * some.radii).prod(-1).sum(), np.prod(box.upper - box.lower), rtol=1e-9)
