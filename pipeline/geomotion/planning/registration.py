"""Progress along repetitions of one motion: which of their poses correspond.

People take different times for the parts of a motion. Registered to their common mean, demonstrations say at which
share of the motion each pose is passed.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.ndimage import uniform_filter1d
from scipy.spatial.distance import cdist

Path = Float[np.ndarray, "pose D"]
ROUNDS = 3
STIFFNESS = 1.0  # squared distance that a whole duration of warping costs, in units of the paths
SMOOTHING = 0.05  # of the path; warping steps of single samples are noise
SLOWEST = 1e-3  # share of the mean pace below which progress never falls


def register(paths: Sequence[Path]) -> list[Float[np.ndarray, " pose"]]:
    """Progress from 0 to 1 at every pose of every path.

    Each path, with its ends brought to the mean ones, is aligned with the mean of all at equal progress by dynamic time
    warping; the mean is then taken anew.

    Args:
        paths: Repetitions, in coordinates in which a distance makes sense, with equal numbers of poses.
    """
    shares = np.linspace(0, 1, len(paths[0]))
    found = [shares] * len(paths)
    for _ in range(ROUNDS):
        mean = np.mean([_at(shares, progress, path) for progress, path in zip(found, paths, strict=True)], axis=0)
        found = [_progress(_with_ends_of(path, mean, shares), mean, shares) for path in paths]
    return found


def _at(wanted: Float[np.ndarray, " _"], progress: Float[np.ndarray, " pose"], path: Path) -> Path:
    return np.stack([np.interp(wanted, progress, coordinate) for coordinate in path.T], axis=1)


def _with_ends_of(path: Path, mean: Path, shares: Float[np.ndarray, " pose"]) -> Path:
    start, goal = mean[0] - path[0], mean[-1] - path[-1]
    return np.asarray(path + (1 - shares)[:, None] * start + shares[:, None] * goal)


def _progress(path: Path, mean: Path, shares: Float[np.ndarray, " pose"]) -> Float[np.ndarray, " pose"]:
    costs = cdist(path, mean, "sqeuclidean") + STIFFNESS * np.subtract.outer(shares, shares) ** 2
    rows, columns = _cheapest_alignment(costs)
    progress = np.bincount(rows, shares[columns]) / np.bincount(rows)
    ahead = uniform_filter1d(progress - shares, max(1, round(SMOOTHING * len(path))), mode="nearest")
    pace = np.maximum(np.diff(shares + ahead), SLOWEST / len(path))
    advanced = np.concatenate([[0.0], np.cumsum(pace)])
    return np.asarray(advanced / advanced[-1])


def _cheapest_alignment(
    costs: Float[np.ndarray, "row column"],
) -> tuple[np.ndarray, np.ndarray]:
    """Monotone alignment of smallest sum, as pairs of numbers; whole anti-diagonals at a time."""
    rows, columns = costs.shape
    sums = np.full((rows + 1, columns + 1), np.inf)
    sums[0, 0] = 0.0
    for diagonal in range(2, rows + columns + 1):
        i = np.arange(max(1, diagonal - columns), min(rows, diagonal - 1) + 1)
        j = diagonal - i
        before = np.minimum(np.minimum(sums[i - 1, j - 1], sums[i - 1, j]), sums[i, j - 1])
        sums[i, j] = costs[i - 1, j - 1] + before
    i, j, pairs = rows, columns, []
    while i > 0 and j > 0:
        pairs.append((i - 1, j - 1))
        step = int(np.argmin((sums[i - 1, j - 1], sums[i - 1, j], sums[i, j - 1])))
        i, j = i - (step != 2), j - (step != 1)
    aligned = np.array(pairs[::-1])
    return aligned[:, 0], aligned[:, 1]
