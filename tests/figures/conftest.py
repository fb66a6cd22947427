"""An evaluation whose every number has a closed form: a linear field behind a shear that bends lines into a J."""

import numpy as np
import pytest

RATE = 0.8  # [1/s], of the slower axis
A = np.diag([-RATE, -2.0])
SIDE = 20


def bend(height):
    return 0.05 * np.sin(np.pi * height / 0.12)


def to_chart(x):
    return np.stack([x[..., 0] - bend(x[..., 1]), x[..., 1]], axis=-1)


def from_chart(z):
    return np.stack([z[..., 0] + bend(z[..., 1]), z[..., 1]], axis=-1)


def trajectories(starts, times):
    z = to_chart(starts)[:, None] * np.exp(np.outer(times, np.diag(A)))[None]
    return from_chart(z)


def velocity(x):
    slope = 0.05 * np.pi / 0.12 * np.cos(np.pi * x[..., 1] / 0.12)
    dz = to_chart(x) @ A
    return np.stack([dz[..., 0] + slope * dz[..., 1], dz[..., 1]], axis=-1)


def true_eigenvalues(x, step=1e-6):
    columns = [(velocity(x + step * unit) - velocity(x - step * unit)) / (2 * step) for unit in np.eye(2)]
    jacobian = np.stack(columns, axis=-1)
    return np.linalg.eigvalsh((jacobian + jacobian.swapaxes(-1, -2)) / 2)[:, -1]


def pairwise(points):
    """Mean distance between trajectories at equal times, points of shape (n, T, D)."""
    first, second = np.triu_indices(len(points), 1)
    return np.linalg.norm(points[first] - points[second], axis=-1).mean(axis=0)


def square(low, high, side):
    axes = [np.linspace(low[i], high[i], side) for i in (0, 1)]
    return np.stack([grid.ravel() for grid in np.meshgrid(*axes, indexing="xy")], axis=-1)


def judged_arrays(rng, numbers, held_out):
    arrays = {}
    for number in numbers:
        times = np.linspace(0, 5, 200)
        start = np.array([-0.01, 0.10]) + 0.004 * rng.standard_normal(2)
        rollout = trajectories(start[None], times)[0]
        wobble = 0.002 * np.sin(np.outer(times, [1.5, 2.3]) + rng.uniform(0, 6, 2)) * (1 - times / 5)[:, None]
        arrays |= {
            f"demo_{number}": rollout + wobble,
            f"rollout_{number}": rollout,
            f"time_{number}": times,
            f"set_{number}": np.array("test" if number in held_out else "train"),
        }
    return arrays


@pytest.fixture(scope="session")
def planar_arrays():
    rng = np.random.default_rng(0)
    arrays = judged_arrays(rng, range(7), held_out={5, 6})
    low, high = np.array([-0.05, -0.03]), np.array([0.09, 0.13])
    grid, starts = square(low, high, SIDE), square(low, high, 10)
    times = np.linspace(0, 5, 1000)
    rollouts = trajectories(starts, times)
    hull = np.array([[-0.02, -0.01], [0.02, -0.01], [0.06, 0.05], [0.05, 0.09], [0.0, 0.12], [-0.025, 0.1]])
    nearby = trajectories(np.array([-0.01, 0.1]) + 0.005 * rng.standard_normal((5, 2)), times)
    claimed = pairwise(to_chart(nearby))
    return arrays | {
        "grid_points": grid,
        "grid_shape": np.array([SIDE, SIDE]),
        "true_eigenvalue": true_eigenvalues(grid),
        "claimed_eigenvalue": np.full(len(grid), -RATE),
        "jhat_eigenvalue": np.empty(0),
        "field_points": grid,
        "field_velocity": velocity(grid),
        "region_hull": hull,
        "region_rollouts": rollouts,
        "region_inside": inside_convex(hull, rollouts),
        "nearby_time": times,
        "nearby_euclidean": pairwise(nearby),
        "nearby_claimed": claimed,
        "nearby_bound": claimed[0] * np.exp(-RATE * times),
        "goal": np.zeros(2),
        "goal_starts": starts,
        "goal_reached": np.ones(len(starts), dtype=bool),
    }


@pytest.fixture(scope="session")
def spatial_arrays():
    """Four dimensions: no plane to draw, scattered points instead of a grid."""
    rng = np.random.default_rng(1)
    flat = judged_arrays(rng, range(3), held_out={2})
    stacked = {name: np.tile(values, (1, 2)) if values.ndim == 2 else values for name, values in flat.items()}
    times = np.linspace(0, 5, 50)
    empty = np.empty(0)
    return stacked | {
        "grid_points": rng.standard_normal((400, 4)),
        "grid_shape": empty,
        "true_eigenvalue": rng.standard_normal(400),
        "claimed_eigenvalue": rng.standard_normal(400) - 3.0,
        "jhat_eigenvalue": np.full(400, -0.01),
        "field_points": empty,
        "field_velocity": empty,
        "region_hull": empty,
        "region_rollouts": empty,
        "region_inside": empty,
        "nearby_time": times,
        "nearby_euclidean": np.exp(-times),
        "nearby_claimed": np.exp(-times),
        "nearby_bound": empty,
        "goal": np.zeros(4),
        "goal_starts": rng.standard_normal((30, 4)),
        "goal_reached": rng.uniform(size=30) > 0.2,
    }


def inside_convex(hull, points):
    """Whether points of shape (..., 2) are to the left of every edge of a counter-clockwise convex polygon."""
    edges = np.roll(hull, -1, axis=0) - hull
    towards = points[..., None, :] - hull
    return (edges[:, 0] * towards[..., 1] - edges[:, 1] * towards[..., 0] >= 0).all(axis=-1)
