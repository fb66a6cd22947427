"""The von Mises-Fisher distribution against its definition (3.3)-(3.5), from no concentration to a point."""

import math

import numpy as np
import pytest
import torch
from scipy.special import ive
from torch.autograd.functional import jvp
from torch.testing import assert_close

from geomotion.errors import ShapeMismatch
from geomotion.networks.von_mises_fisher import (
    SERIES_BELOW,
    antipodal_log_density,
    log_density,
    log_normaliser,
)

CONCENTRATIONS = [0.0, 1e-6, 1e-3, 0.1, 1.0, 30.0, 1e3, 1e6]
DIMS = [3, 4]


def unit_vectors(count: int, dim: int, seed: int = 0) -> torch.Tensor:
    vectors = torch.randn(count, dim, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))
    return vectors / vectors.norm(dim=-1, keepdim=True)


def at_angles(angles: torch.Tensor, dim: int) -> torch.Tensor:
    """Unit vectors at angles [rad] to the last axis."""
    q = torch.zeros(len(angles), dim, dtype=angles.dtype)
    q[:, 0], q[:, -1] = angles.sin(), angles.cos()
    return q


@pytest.mark.parametrize("density", [log_density, antipodal_log_density])
@pytest.mark.parametrize("concentration", CONCENTRATIONS)
@pytest.mark.parametrize("dim", DIMS)
def test_it_integrates_to_one_over_the_sphere(dim, concentration, density):
    bulk = min(np.pi / 2, 12 / math.sqrt(concentration + 1e-12))  # Gauss-Legendre where the mass is, at both poles
    nodes, weights = (torch.from_numpy(part) for part in np.polynomial.legendre.leggauss(200))
    total = 0.0
    for low, high in ((0.0, bulk), (bulk, np.pi - bulk), (np.pi - bulk, np.pi)):
        angles = (high - low) / 2 * nodes + (high + low) / 2
        mean = torch.tensor([0.0] * (dim - 1) + [1.0], dtype=torch.float64).expand(len(angles), dim)
        values = density(at_angles(angles, dim), mean, torch.full((len(angles),), concentration).double()).exp()
        ring = 2 * np.pi * angles.sin() if dim == 3 else 4 * np.pi * angles.sin().square()
        total += float((values * ring * weights).sum() * (high - low) / 2)
    assert total == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("dim", DIMS)
def test_it_is_the_formula_of_the_thesis(dim):
    kappa = np.logspace(-5, 6, 400)
    order = dim / 2 - 1
    expected = order * np.log(kappa) - dim / 2 * np.log(2 * np.pi) - np.log(ive(order, kappa))  # ive is I times exp(-κ)
    np.testing.assert_allclose(log_normaliser(torch.from_numpy(kappa), dim).numpy(), expected, rtol=0, atol=1e-13)
    q, mean = unit_vectors(20, dim), unit_vectors(20, dim, seed=1)
    some = torch.linspace(0.1, 50, 20).double()
    c_d = some**order / ((2 * math.pi) ** (dim / 2) * torch.from_numpy(ive(order, some.numpy())) * some.exp())
    assert_close(log_density(q, mean, some).exp(), c_d * (some * (q * mean).sum(dim=-1)).exp())


@pytest.mark.parametrize("dim", DIMS)
def test_without_concentration_it_is_uniform(dim):
    area = {3: 4 * math.pi, 4: 2 * math.pi**2}[dim]
    q, mean = unit_vectors(10, dim), unit_vectors(10, dim, seed=1)
    for density in (log_density, antipodal_log_density):
        assert_close(density(q, mean, torch.zeros(10).double()), torch.full((10,), -math.log(area)).double())


@pytest.mark.parametrize("dim", DIMS)
def test_the_derivative_of_the_normalisation_is_one_less_the_mean_alignment(dim):
    kappa = torch.tensor([0.0, 1e-12, 1e-6, 0.009, SERIES_BELOW, 0.011, 1.0, 100.0, 1e5], dtype=torch.float64)
    _, slope = jvp(lambda k: log_normaliser(k, dim), kappa, torch.ones_like(kappa))
    alignment = kappa.numpy() / dim  # I_{D/2}(κ) / I_{D/2-1}(κ), its first term for small κ
    large = kappa.numpy() >= 1e-6
    alignment[large] = ive(dim / 2, kappa.numpy()[large]) / ive(dim / 2 - 1, kappa.numpy()[large])
    np.testing.assert_allclose(slope.numpy(), 1 - alignment, rtol=0, atol=1e-11)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("density", [log_density, antipodal_log_density])
@pytest.mark.parametrize("dim", DIMS)
def test_values_and_gradients_are_finite_at_every_concentration(dim, density, dtype):
    q, mean = unit_vectors(8, dim).to(dtype), unit_vectors(8, dim, seed=1).to(dtype)
    mean[0], mean[1] = q[0], -q[1]
    for concentration in CONCENTRATIONS:
        kappa = torch.full((8,), concentration, dtype=dtype, requires_grad=True)
        inputs = (q.clone().requires_grad_(), mean.clone().requires_grad_(), kappa)
        values = density(*inputs)
        assert values.dtype is dtype and values.isfinite().all()
        for gradient in torch.autograd.grad(values.sum(), inputs):
            assert gradient.isfinite().all()


@pytest.mark.parametrize("dim", DIMS)
def test_single_precision_agrees_with_double(dim):
    kappa = torch.logspace(-8, 5, 300, dtype=torch.float64)
    single = kappa.float().requires_grad_()
    assert_close(log_normaliser(single, dim).double(), log_normaliser(single.double(), dim), atol=2e-6, rtol=2e-6)
    double = kappa.float().double().requires_grad_()
    (slope,) = torch.autograd.grad(log_normaliser(single, dim).sum(), single)
    (expected,) = torch.autograd.grad(log_normaliser(double, dim).sum(), double)
    assert_close(slope.double(), expected, atol=1e-4, rtol=0)  # I_0 - I_1 cancels


@pytest.mark.parametrize("dim", DIMS)
def test_only_the_mixture_is_the_same_for_both_signs(dim):
    q, mean, kappa = unit_vectors(50, dim), unit_vectors(50, dim, seed=1), torch.logspace(-1, 3, 50).double()
    assert_close(antipodal_log_density(q, mean, kappa), antipodal_log_density(-q, mean, kappa), rtol=0, atol=0)
    difference = log_density(q, mean, kappa) - log_density(-q, mean, kappa)
    assert_close(difference, 2 * kappa * (q * mean).sum(dim=-1))
    half = torch.logaddexp(log_density(q, mean, kappa), log_density(-q, mean, kappa)) - math.log(2)
    assert_close(antipodal_log_density(q, mean, kappa), half)


@pytest.mark.parametrize("dim", DIMS)
def test_near_a_concentrated_mean_the_mixture_is_half_of_the_plain_density(dim):
    mean = unit_vectors(50, dim)
    q = mean + 0.05 * unit_vectors(50, dim, seed=1)
    q = q / q.norm(dim=-1, keepdim=True)
    kappa = torch.full((50,), 1e4).double()
    assert_close(antipodal_log_density(q, mean, kappa), log_density(q, mean, kappa) - math.log(2))


@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
def test_any_batch_is_taken(batch):
    q = unit_vectors(math.prod(batch), 4).reshape(*batch, 4)
    assert log_density(q, q, torch.ones(batch).double()).shape == batch
    assert antipodal_log_density(q, q, torch.ones(batch).double()).shape == batch


def test_other_spheres_are_refused():
    with pytest.raises(ShapeMismatch, match="3 or 4 components, found 5"):
        log_normaliser(torch.ones(2), 5)
