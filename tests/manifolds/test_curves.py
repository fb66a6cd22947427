"""Lengths, energies and geodesics of curves against closed forms."""

import math

import numpy as np
import pytest
import torch
from torch.testing import assert_close

from geomotion.manifolds.curves import chord_lengths, curve_energy, curve_length, descend, straight_line
from geomotion.manifolds.spline import fit_spline

START, GOAL = torch.tensor([1.0, 0.1]).double(), torch.tensor([1.3, 1.9]).double()


def curves(*batch: int) -> torch.Tensor:
    return torch.randn(*batch, 30, 4, dtype=torch.float64, generator=torch.Generator().manual_seed(0)).cumsum(dim=-2)


def identity(z: torch.Tensor) -> torch.Tensor:
    return z


def spline(points: torch.Tensor, control_points: int = 12) -> tuple[torch.Tensor, torch.Tensor]:
    """Basis at 200 points and coefficients."""
    fitted = fit_spline(points.numpy(), control_points)
    return torch.from_numpy(fitted.basis(200)), torch.from_numpy(fitted.coefficients)


@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
def test_energy_is_at_least_the_squared_length(batch):
    embedded = curves(*batch)
    assert (curve_energy(embedded) >= curve_length(embedded).square()).all()
    assert curve_energy(embedded).shape == curve_length(embedded).shape == batch
    assert_close(chord_lengths(embedded).sum(dim=-1), curve_length(embedded))


def test_energy_is_the_squared_length_at_constant_speed():
    t = torch.linspace(0, 2, 50).double()
    circle = torch.stack([t.cos(), t.sin()], dim=-1)
    assert_close(curve_energy(circle), curve_length(circle).square())
    assert_close(curve_energy(circle.expand(3, 50, 2)), curve_energy(circle).expand(3))


def test_a_conformal_factor_stretches_every_piece():
    embedded = curves()
    assert_close(curve_energy(embedded, torch.full((30,), 3.0).double()), 9 * curve_energy(embedded))
    assert_close(curve_energy(embedded, torch.ones(30).double()), curve_energy(embedded))
    stretch = torch.linspace(1, 2, 30).double()
    pieces = (stretch[1:] + stretch[:-1]) / 2 * chord_lengths(embedded)
    assert_close(curve_energy(embedded, stretch), 29 * pieces.square().sum())


def test_a_straight_line_has_even_steps_between_its_ends():
    line = straight_line(START, GOAL, 7)
    assert_close(line, torch.from_numpy(np.linspace(START.numpy(), GOAL.numpy(), 7)), rtol=0, atol=1e-15)


def test_descent_finds_the_straight_line_of_a_flat_space():
    bent = straight_line(START, GOAL, 40)
    bent = bent + 0.5 * torch.linspace(0, math.pi, 40).double().sin()[:, None] * torch.tensor([1.0, -1.0])
    basis, coefficients = spline(bent)
    found = descend(identity, basis, coefficients, steps=200)
    assert float(curve_length(basis @ found.coefficients)) == pytest.approx(float((GOAL - START).norm()), rel=1e-3)
    assert curve_length(basis @ coefficients) > 1.2 * (GOAL - START).norm()


def test_descent_finds_the_great_circle_of_a_sphere(sphere):
    decoder = sphere()

    def point(z: torch.Tensor) -> torch.Tensor:
        return decoder.positions(z)[:, 0]

    basis, coefficients = spline(straight_line(START, GOAL, 40))
    found = descend(point, basis, coefficients, steps=200)
    ends = point(torch.stack([START, GOAL]))
    angle = float((ends[0] @ ends[1]).clamp(-1, 1).acos())
    curve = point(basis @ found.coefficients)
    assert float(curve_length(point(basis @ coefficients))) > 1.02 * angle
    assert float(curve_length(curve)) == pytest.approx(angle, rel=2e-4)
    normal = torch.linalg.cross(ends[0], ends[1])
    assert (curve @ (normal / normal.norm())).abs().max() < 0.02
    assert float(curve_energy(curve)) == pytest.approx(angle**2, rel=1e-3)  # at constant speed


@pytest.mark.parametrize("learning_rate", [0.01, 5.0])
def test_descent_keeps_the_ends_and_never_ends_above_where_it_began(random_decoder, learning_rate):
    decoder = random_decoder()

    def embedding(z: torch.Tensor) -> torch.Tensor:
        position, rest = decoder.blocks(z)
        return torch.cat([position.flatten(-2), rest], dim=-1)

    basis, coefficients = spline(straight_line(START, GOAL, 40))
    before = coefficients.clone()
    found = descend(embedding, basis, coefficients, 20, learning_rate, conformal=lambda z: 1 + z[..., 0].square())
    assert_close(found.coefficients[[0, -1]], coefficients[[0, -1]], rtol=0, atol=0)
    assert_close(coefficients, before, rtol=0, atol=0)
    assert len(found.energies) == 21
    points = basis @ found.coefficients
    energy = curve_energy(embedding(points), 1 + points[..., 0].square())
    assert float(energy) == pytest.approx(min(found.energies))
    assert float(energy) <= found.energies[0]


def test_without_steps_the_curve_is_as_it_was():
    basis, coefficients = spline(straight_line(START, GOAL, 40))
    found = descend(identity, basis, coefficients, steps=0)
    assert_close(found.coefficients, coefficients, rtol=0, atol=0)
    assert len(found.energies) == 1
