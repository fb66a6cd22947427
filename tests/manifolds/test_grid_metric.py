"""Metrics from differences on a grid against exact ones, on decoders with known geometry."""

import numpy as np
import pytest
import torch

from geomotion.errors import InvalidSetting
from geomotion.manifolds.grid import LatentGrid
from geomotion.manifolds.grid_metric import metric_on_grid
from geomotion.manifolds.metric import PullbackMetric, log_magnification


def grid(dim, points_per_axis):
    return LatentGrid(np.full(dim, 0.4), np.full(dim, 1.4), points_per_axis)


def embedded(decoder, nodes):
    return [block.numpy() for block in decoder.blocks(torch.from_numpy(nodes))]


def ball_factor(positions):
    """Grows near the origin, differently for each point."""
    return 1 + 5 * np.exp(-np.square(positions).sum(axis=-1))


def conformal(z):
    return 1 + z.square().sum(dim=-1)


def error(decoder, points_per_axis, dim, is_shaped=True):
    """Largest difference between entries of the metric and the exact ones, everywhere and inside the border."""
    own = grid(dim, points_per_axis)
    nodes = torch.from_numpy(own.nodes)
    position, rest = embedded(decoder, own.nodes)
    ambient = (lambda positions: torch.from_numpy(ball_factor(positions.numpy()))) if is_shaped else None
    exact = PullbackMetric(decoder, ambient, conformal if is_shaped else None)(nodes).numpy()
    shapes = (ball_factor(position).T, conformal(nodes).numpy()) if is_shaped else ()
    return np.abs(metric_on_grid(own, position, rest, *shapes) - exact).max() / np.abs(exact).max()


@pytest.mark.parametrize(("dim", "points"), [(2, 11), (3, 9)])
def test_a_linear_decoder_has_the_exact_metric_at_every_node(dim, points):
    rng = np.random.default_rng(0)
    matrices, other = rng.standard_normal((4, 3, dim)), rng.standard_normal((5, dim))
    own = grid(dim, points)
    position, rest = np.einsum("bpd,nd->nbp", matrices, own.nodes), own.nodes @ other.T
    factor = rng.uniform(1, 3, (4, len(own.nodes)))
    expected = np.einsum("bn,bpi,bpj->nij", factor, matrices, matrices) + other.T @ other
    np.testing.assert_allclose(metric_on_grid(own, position, rest, factor), expected, atol=1e-10)


def test_a_sphere_is_magnified_by_its_area(sphere):
    own = grid(2, 81)
    metric = metric_on_grid(own, *embedded(sphere(2.0), own.nodes))
    found = log_magnification(torch.from_numpy(metric)).numpy()
    np.testing.assert_allclose(found, np.log(4 * np.sin(own.nodes[:, 0])), atol=2e-4)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("is_shaped", [False, True], ids=["thesis metric", "obstacles and density"])
def test_the_error_is_of_second_order_in_the_cell(random_decoder, dim, is_shaped):
    decoder = random_decoder(dim, positions=2)
    coarse, fine = (error(decoder, points, dim, is_shaped) for points in (9, 17))
    assert 3 < coarse / fine < 5.5
    assert fine < 0.01


def test_two_nodes_along_an_axis_are_too_few(sphere):
    own = grid(2, 2)
    with pytest.raises(InvalidSetting, match="points_per_axis"):
        metric_on_grid(own, *embedded(sphere(), own.nodes))
