"""Splines on planar grids: values, order of convergence, derivatives."""

import numpy as np
import pytest
import torch

from geomotion.errors import ShapeMismatch
from geomotion.manifolds.grid import LatentGrid
from geomotion.manifolds.grid_spline import GridSpline


def grid(points_per_axis: int) -> LatentGrid:
    return LatentGrid(np.array([-1.0, 0.0]), np.array([1.0, 3.0]), points_per_axis)


def waves(points: np.ndarray) -> np.ndarray:
    return np.stack([np.sin(2 * points[:, 0]) * np.cos(points[:, 1]), points[:, 0] * points[:, 1]], axis=1)


INNER = torch.rand(100, 2, generator=torch.Generator().manual_seed(0), dtype=torch.float64) * torch.tensor(
    [1.2, 1.8]
) + torch.tensor([-0.6, 0.6])


def test_it_goes_through_the_values():
    nodes = grid(12)
    found, _ = GridSpline(nodes, waves(nodes.nodes))(torch.from_numpy(nodes.nodes))
    np.testing.assert_allclose(found.numpy(), waves(nodes.nodes), atol=1e-12)


def test_its_error_falls_with_the_fourth_power_of_the_cell():
    errors = []
    for count in (41, 81):
        found, _ = GridSpline(grid(count), waves(grid(count).nodes))(INNER)
        errors.append(np.abs(found.numpy() - waves(INNER.numpy())).max())
    assert np.log2(errors[0] / errors[1]) > 3.7


def test_gradients_are_those_of_the_values():
    spline = GridSpline(grid(15), waves(grid(15).nodes))
    points = INNER.clone().requires_grad_()
    values, gradients = spline(points)
    for quantity in range(2):
        wanted = torch.autograd.grad(values[:, quantity].sum(), points, retain_graph=True)[0]
        torch.testing.assert_close(gradients[:, quantity], wanted)


def test_gradients_are_continuous_from_cell_to_cell():
    spline = GridSpline(grid(15), waves(grid(15).nodes))
    corner = torch.from_numpy(grid(15).nodes[7 * 15 + 7])
    _, before = spline(corner - 1e-9)
    _, after = spline(corner + 1e-9)
    torch.testing.assert_close(before, after, atol=1e-6, rtol=0)


def test_points_outside_count_as_on_the_border():
    spline = GridSpline(grid(9), waves(grid(9).nodes))
    outside = torch.tensor([[-3.0, 1.0]], dtype=torch.float64)
    border = torch.tensor([[-1.0, 1.0]], dtype=torch.float64)
    torch.testing.assert_close(spline(outside)[0], spline(border)[0])
    torch.testing.assert_close(spline.nearest(outside), border)


@pytest.mark.parametrize("values", [np.zeros((80, 1)), np.zeros((729, 1))])
def test_it_needs_one_row_for_each_node(values):
    with pytest.raises(ShapeMismatch):
        GridSpline(grid(9), values)


def test_it_is_planar():
    space = LatentGrid(np.zeros(3), np.ones(3), 5)
    with pytest.raises(ShapeMismatch):
        GridSpline(space, np.zeros((125, 1)))
