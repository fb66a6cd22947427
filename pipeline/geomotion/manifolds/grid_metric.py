"""The pulled-back metric at all nodes of a grid, from differences of what they decode to."""

from itertools import combinations_with_replacement

import numpy as np
from jaxtyping import Float

from geomotion.errors import InvalidSetting
from geomotion.manifolds.grid import LatentGrid


def metric_on_grid(
    grid: LatentGrid,
    position: Float[np.ndarray, "node B P"],
    rest: Float[np.ndarray, "node Q"],
    factor: Float[np.ndarray, "B node"] | None = None,
    conformal: Float[np.ndarray, " node"] | None = None,
) -> Float[np.ndarray, "node d d"]:
    r"""M = f² (Σ_b m_b J_bᵀ J_b + J_oᵀ J_o), with central differences for the Jacobians, one-sided ones on the border.

    The error is of second order in the size of a cell. Differences of embedded coordinates that are known anyway cost
    thousands of times less than the Jacobians of :class:`geomotion.manifolds.metric.PullbackMetric`; where the spread
    rises within less than a cell, like a wall, they show the wall as wide as two cells.

    Args:
        grid: Nodes, three or more along each axis.
        position: Embedded positions, one block for each point that obstacles act on.
        rest: Other embedded coordinates.
        factor: Ambient factors m of obstacles; 1 if omitted.
        conformal: f; 1 if omitted, which is the thesis' metric.

    Raises:
        InvalidSetting: If an axis has fewer than three nodes.

    Source: Thesis Eq. (2.11), (3.14)-(3.16), (4.3), (4.4).
    """
    if grid.points_per_axis < 3:
        raise InvalidSetting("graph.points_per_axis", grid.points_per_axis, "3 or more")
    metric = np.zeros((len(position), grid.dim, grid.dim))
    for block in range(position.shape[1]):
        gram = _gram(grid, position[:, block])
        metric += gram if factor is None else factor[block, :, None, None] * gram
    metric += _gram(grid, rest)
    return metric if conformal is None else np.square(conformal)[:, None, None] * metric


def _gram(grid: LatentGrid, embedded: Float[np.ndarray, "node k"]) -> Float[np.ndarray, "node d d"]:
    """JᵀJ of some coordinates, one after the other: the Jacobians of all nodes would be larger than the graph."""
    gram = np.zeros((len(embedded), grid.dim, grid.dim))
    for column in embedded.T:
        slopes = [slope.ravel() for slope in np.gradient(column.reshape(grid.shape), *grid.cell, edge_order=2)]
        for row, other in combinations_with_replacement(range(grid.dim), 2):
            gram[:, row, other] += slopes[row] * slopes[other]
    upper = np.triu_indices(grid.dim, 1)
    gram[:, upper[1], upper[0]] = gram[:, upper[0], upper[1]]
    return gram
