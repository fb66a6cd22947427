"""Pulled-back metrics against closed forms and the properties that every decoder gives them."""

import math

import numpy as np
import pytest
import torch
from torch.func import jacrev, vmap
from torch.testing import assert_close

from geomotion.errors import ShapeMismatch
from geomotion.manifolds.curves import curve_length
from geomotion.manifolds.immersion import Immersion
from geomotion.manifolds.metric import PullbackMetric, log_magnification
from geomotion.obstacles.ambient import ambient_factor


def latent(*batch: int, dim: int = 2) -> torch.Tensor:
    return torch.rand(*batch, dim, dtype=torch.float64, generator=torch.Generator().manual_seed(0)) + 0.5


def obstacle(centre: torch.Tensor, radius: float = 0.1, gain: float = 100.0):
    """The ambient factor of (3.15) around a ball."""

    def factor(positions: torch.Tensor) -> torch.Tensor:
        distances = ((positions - centre).norm(dim=-1) - radius).detach().numpy()
        return torch.from_numpy(ambient_factor(distances, radius, gain))

    return factor


def test_a_sphere_has_the_round_metric_and_its_area(sphere):
    z = latent(50)
    metric = PullbackMetric(sphere(2.0))(z)
    expected = 4 * torch.diag_embed(torch.stack([torch.ones(50).double(), z[:, 0].sin().square()], dim=-1))
    assert_close(metric, expected)
    assert_close(log_magnification(metric), (4 * z[:, 0].sin()).log())


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("seed", range(3))
def test_the_metric_of_any_decoder_is_symmetric_and_positive_semi_definite(random_decoder, dim, seed):
    decoder = random_decoder(dim, seed=seed)
    assert isinstance(decoder, Immersion)
    metric = PullbackMetric(decoder)(latent(40, dim=dim))
    assert_close(metric, metric.mT)
    assert torch.linalg.eigvalsh(metric).min() >= -1e-12


def test_it_grows_with_the_square_of_the_decoder(random_decoder):
    one, threefold = (PullbackMetric(random_decoder(scale=scale))(latent(20)) for scale in (1.0, 3.0))
    assert_close(threefold, 9 * one)
    assert_close(log_magnification(threefold) - log_magnification(one), torch.full((20,), math.log(9)).double())


def test_a_conformal_factor_counts_twice(random_decoder):
    decoder, z = random_decoder(), latent(20)
    weighted = PullbackMetric(decoder, conformal=lambda z: 1 + z.square().sum(dim=-1))
    assert_close(weighted(z), (1 + z.square().sum(dim=-1)).square()[:, None, None] * PullbackMetric(decoder)(z))


def test_blocks_add_up_each_weighed_by_the_factor_at_its_own_position(random_decoder):
    decoder, z = random_decoder(positions=2), latent(60)
    *of_positions, of_rest = (vmap(jacrev(network))(z) for network in decoder.networks)
    factors = torch.rand(60, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(3)) * 50 + 1
    expected = sum(m[:, None, None] * J.mT @ J for m, J in zip(factors.T, of_positions, strict=True))
    expected = expected + of_rest.mT @ of_rest
    places = decoder.positions(z)

    def at_places(positions: torch.Tensor) -> torch.Tensor:
        assert_close(positions, places)
        return factors

    assert_close(PullbackMetric(decoder, ambient=at_places)(z), expected)


@pytest.mark.parametrize("positions", [1, 2, 5])
def test_an_obstacle_only_adds_acts_on_positions_alone_and_is_not_felt_far_away(random_decoder, positions):
    decoder, z = random_decoder(positions=positions), latent(60)
    places = decoder.positions(z)
    plain, at_rest = PullbackMetric(decoder)(z), obstacle(places[0, 0])
    added = PullbackMetric(decoder, ambient=at_rest)(z) - plain
    assert torch.linalg.eigvalsh(added).min() >= -1e-12
    assert torch.linalg.eigvalsh(added)[0, -1] > 10
    decoder.networks[-1] = lambda z: torch.zeros_like(z)
    of_positions = PullbackMetric(decoder)(z)
    one_by_one = vmap(jacrev(decoder.positions))(z)
    assert_close(added, ((at_rest(places) - 1)[..., None, None] * (one_by_one.mT @ one_by_one)).sum(dim=1))
    assert_close(PullbackMetric(decoder, ambient=obstacle(places[0, 0] + 10))(z), of_positions, rtol=0, atol=0)


@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
def test_any_batch_is_taken(random_decoder, batch):
    decoder, z = random_decoder(), latent(*batch)
    metric = PullbackMetric(decoder, obstacle(torch.zeros(3)), lambda z: 1 + z[..., 0])
    found = metric(z)
    assert found.shape == (*batch, 2, 2)
    assert log_magnification(found).shape == batch
    assert_close(found.reshape(-1, 2, 2)[0], metric(z.reshape(-1, 2)[0]))


def test_the_length_of_chords_converges_to_that_of_the_metric_at_second_order(random_decoder):
    decoder = random_decoder()

    def curve(t: torch.Tensor) -> torch.Tensor:
        return torch.stack([t + 0.3 * (3 * t).sin(), (2 * t).cos()], dim=-1)

    nodes, weights = (torch.from_numpy(part) for part in np.polynomial.legendre.leggauss(60))
    t = (nodes + 1) / 2
    velocity = torch.stack([1 + 0.9 * (3 * t).cos(), -2 * (2 * t).sin()], dim=-1)
    speed = torch.einsum("pi,pij,pj->p", velocity, PullbackMetric(decoder)(curve(t)), velocity).sqrt()
    exact = (speed * weights).sum() / 2  # Eq. (2.3)

    def side_by_side(points: torch.Tensor) -> torch.Tensor:
        position, rest = decoder.blocks(points)
        return torch.cat([position.flatten(-2), rest], dim=-1)

    errors = []
    for count in (21, 41, 81):
        points = curve(torch.linspace(0, 1, count).double())
        errors.append(float(exact - curve_length(side_by_side(points))))  # Eq. (2.2)
    assert all(error > 0 for error in errors)
    assert math.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.05)
    assert math.log2(errors[1] / errors[2]) == pytest.approx(2, abs=0.02)


def test_where_the_decoder_is_flat_the_volume_is_finite_and_smallest(sphere):
    at_pole = torch.tensor([[0.0, 0.3]]).double()
    found = log_magnification(PullbackMetric(sphere())(at_pole))
    assert found.isfinite().all() and found < -100


def test_points_of_another_dimension_are_refused(sphere):
    with pytest.raises(ShapeMismatch, match="2 coordinates, found 3"):
        PullbackMetric(sphere())(latent(4, dim=3))
