"""The density of encoded demonstrations as a conformal factor."""

import math

import pytest
import torch
from torch.testing import assert_close

from geomotion.manifolds.density import (
    LARGEST_FACTOR,
    SMALLEST_FACTOR,
    DensityFactor,
    GroupedDensity,
    mean_distance_between,
)


def line(offset: float, points: int = 50) -> torch.Tensor:
    """A straight demonstration at some height."""
    return torch.stack([torch.linspace(0, 5, points).double(), torch.full((points,), offset).double()], dim=-1)


def at(*coordinates: float) -> torch.Tensor:
    return torch.tensor(coordinates, dtype=torch.float64)


def test_it_is_the_formula():
    codes, z = [line(0.0), line(0.2)], torch.rand(20, 2, generator=torch.Generator().manual_seed(0)).double()

    def density(points: torch.Tensor) -> torch.Tensor:
        squares = (points[:, None] - torch.cat(codes)).square().sum(dim=-1)
        return (-squares / (2 * 0.3**2)).exp().mean(dim=1)

    reference = torch.quantile(density(torch.cat(codes)), 0.9)
    assert_close(DensityFactor(torch.cat(codes), 0.3, 2.0)(z), (reference / density(z)).square())


def test_it_is_about_one_inside_the_data_and_large_away_from_it():
    factor = DensityFactor(torch.cat([line(offset) for offset in (-0.1, 0.0, 0.1)]), 0.2, 1.0)
    inside, beside, outside = factor(at(2.5, 0.0)), factor(at(2.5, 0.6)), factor(at(2.5, 40.0))
    assert inside == pytest.approx(1, abs=0.05)
    assert 10 < beside < LARGEST_FACTOR
    assert outside == LARGEST_FACTOR
    heights = factor(torch.stack([torch.full((50,), 2.5), torch.linspace(0, 2, 50)], dim=-1).double())
    assert (heights.diff() >= 0).all()


def test_a_power_of_zero_is_the_metric_of_the_thesis():
    z = torch.randn(4, 3, 2).double()
    assert_close(DensityFactor(line(0.0), 0.2, 0.0)(z), torch.ones(4, 3).double(), rtol=0, atol=0)


def test_powers_are_powers():
    z = at(2.5, 0.5)
    one, two = (DensityFactor(line(0.0), 0.3, power)(z) for power in (1.0, 2.0))
    assert_close(two, one.square())


def test_groups_weigh_the_same_however_many_demonstrations_they_have():
    many, few = torch.cat([line(0.0)] * 9), line(10.0)
    grouped = GroupedDensity([DensityFactor(many, 0.3, 1.0), DensityFactor(few, 0.3, 1.0)])
    for height in (0.0, 0.2, 0.5):
        assert_close(grouped(at(2.5, height)), grouped(at(2.5, 10 - height)))
    together = DensityFactor(torch.cat([many, few]), 0.3, 1.0)
    assert together(at(2.5, 10.0)) == pytest.approx(9 * float(together(at(2.5, 0.0))))


def test_a_wide_group_is_no_worse_than_a_narrow_one():
    narrow = torch.cat([line(offset) for offset in (-0.1, 0.0, 0.1)])
    wide = torch.cat([line(offset) for offset in (9.0, 10.0, 11.0)])
    grouped = GroupedDensity([DensityFactor(narrow, 0.1, 1.0), DensityFactor(wide, 1.0, 1.0)])
    ends_felt = 0.05  # by wide kernels on lines of finite length
    assert grouped(at(2.5, 10.0)) == pytest.approx(float(grouped(at(2.5, 0.0))), rel=ends_felt)


def test_very_dense_places_do_not_become_free():
    codes = torch.cat([line(1.0, 2000), torch.zeros(100, 2).double()])
    assert DensityFactor(codes, 0.001, 3.0)(at(0.0, 0.0)) == SMALLEST_FACTOR


@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
def test_any_batch_is_taken_and_gradients_are_finite(batch):
    z = torch.randn(*batch, 2, dtype=torch.float64).requires_grad_()
    found = DensityFactor(line(0.0), 0.3, 2.0)(z)
    assert found.shape == batch
    (gradient,) = torch.autograd.grad(found.sum(), z)
    assert gradient.isfinite().all()


def test_the_distance_between_demonstrations_is_that_to_the_nearest_points_within_groups():
    codes = [line(0.0), line(0.3), line(7.0), line(7.5)]
    assert mean_distance_between(codes, (0, 0, 1, 1)) == pytest.approx(0.4)
    assert mean_distance_between(codes[:3], (0, 0, 1)) == pytest.approx(0.3)


def test_where_demonstrations_do_not_differ_their_spacing_stands_for_it():
    spacing = 5 / 49
    assert mean_distance_between([line(0.0)], (0,)) == pytest.approx(spacing)
    assert mean_distance_between([line(0.0), line(3.0)], (0, 1)) == pytest.approx(spacing)
    same = [line(0.0), line(0.0)]
    assert mean_distance_between(same, (0, 0)) == pytest.approx(spacing)
    assert math.isfinite(DensityFactor(torch.cat(same), mean_distance_between(same, (0, 0)), 2.0)(at(1.0, 1.0)))
