"""Latent grids: neighbours, interpolation, and memory asked for before it is taken."""

import tracemalloc

import numpy as np
import pytest

from geomotion.errors import InvalidSetting, TooLargeForMemory
from geomotion.manifolds.grid import LatentGrid, memory_bytes, require_memory

GIB = 2**30


def grid(points_per_axis: int = 6, dim: int = 2) -> LatentGrid:
    return LatentGrid(np.array([-1.0, 2.0, 0.0])[:dim], np.array([1.0, 3.0, 5.0])[:dim], points_per_axis)


def inside(count: int, dim: int, seed: int = 0) -> np.ndarray:
    found = grid(dim=dim)
    return np.random.default_rng(seed).uniform(found.low, found.high, size=(count, dim))


@pytest.mark.parametrize(("dim", "neighbours"), [(1, 2), (2, 8), (3, 26)])
@pytest.mark.parametrize("points_per_axis", [2, 3, 6])
def test_every_pair_of_neighbours_is_one_edge(dim, neighbours, points_per_axis):
    found = grid(points_per_axis, dim)
    edges = np.sort(found.edges, axis=1)
    assert len(np.unique(edges, axis=0)) == len(edges) == ((3 * points_per_axis - 2) ** dim - points_per_axis**dim) // 2
    places = np.stack(np.unravel_index(found.edges, found.shape), axis=-1)
    assert (np.abs(np.diff(places, axis=1)).max(axis=(1, 2)) == 1).all()
    if points_per_axis > 2:
        middle = np.ravel_multi_index((1,) * dim, found.shape)
        assert (edges == middle).sum() == neighbours


@pytest.mark.parametrize("dim", [2, 3])
def test_nodes_fill_the_box_evenly(dim):
    found = grid(6, dim)
    assert found.nodes.shape == (6**dim, dim)
    np.testing.assert_allclose(found.nodes.min(axis=0), found.low)
    np.testing.assert_allclose(found.nodes.max(axis=0), found.high)
    places = np.stack(np.unravel_index(np.arange(6**dim), found.shape), axis=-1)
    np.testing.assert_allclose(found.nodes, found.low + places * found.cell)


@pytest.mark.parametrize("dim", [2, 3])
def test_the_nearest_node_is_the_nearest_of_all(dim):
    found, points = grid(6, dim), inside(200, dim)
    offsets = (points[:, None] - found.nodes) / found.cell
    np.testing.assert_array_equal(found.nearest(points), np.square(offsets).sum(axis=2).argmin(axis=1))
    np.testing.assert_array_equal(found.nearest(found.nodes), np.arange(6**dim))


def test_points_outside_count_as_on_the_border():
    found = grid()
    outside, border = np.array([[-9.0, 2.45], [5.0, 99.0]]), np.array([[-1.0, 2.45], [1.0, 3.0]])
    np.testing.assert_array_equal(found.contains(outside), False)
    np.testing.assert_array_equal(found.contains(border), True)
    np.testing.assert_array_equal(found.nearest(outside), found.nearest(border))
    np.testing.assert_allclose(found.interpolate(found.nodes, outside), border)


@pytest.mark.parametrize("dim", [2, 3])
def test_multilinear_functions_are_interpolated_exactly(dim):
    found, points = grid(6, dim), inside(200, dim)

    def function(z: np.ndarray) -> np.ndarray:
        return np.stack([1 + z @ np.arange(1.0, dim + 1), z.prod(axis=1)], axis=1)

    np.testing.assert_allclose(found.interpolate(function(found.nodes), points), function(points))
    values = np.random.default_rng(1).normal(size=(6**dim, 4))
    np.testing.assert_allclose(found.interpolate(values, found.nodes), values, atol=1e-12)


def test_a_grid_around_points_has_the_wanted_margin():
    found = LatentGrid.around(np.array([[0.0, 10.0], [2.0, 14.0], [1.0, 11.0]]), 5, margin=0.25)
    np.testing.assert_allclose([found.low, found.high], [[-0.5, 9.0], [2.5, 15.0]])
    assert found.dim == 2 and found.shape == (5, 5)


def test_a_grid_too_large_for_memory_is_refused_before_anything_is_allocated():
    tracemalloc.start()
    with pytest.raises(TooLargeForMemory) as refused:
        require_memory(10**6, 3, 4 * GIB)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1e6
    needed = memory_bytes(10**6, 3)
    assert refused.value.needed_bytes == needed
    assert f"1000000^3 nodes would need about {needed / GIB:.3g} GiB, the limit is 4 GiB" in str(refused.value)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("limit", [GIB // 100, GIB, 4 * GIB])
def test_the_size_that_is_said_to_fit_is_the_largest_that_does(dim, limit):
    with pytest.raises(TooLargeForMemory, match=r"graph\.points_per_axis=") as refused:
        require_memory(10**7, dim, limit)
    fitting = int(refused.value.fitting.split("=")[1])
    require_memory(fitting, dim, limit)
    with pytest.raises(TooLargeForMemory):
        require_memory(fitting + 1, dim, limit)


def test_an_axis_needs_two_points():
    with pytest.raises(InvalidSetting, match=r"points_per_axis=1 is not valid: expected 2 or more"):
        require_memory(1, 2, GIB)
