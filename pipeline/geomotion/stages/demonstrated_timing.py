"""The demonstrations' own timing for a planned path."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

SAMPLES = 60
LEAST = 1e-3  # share of the time that is spread evenly over a path: none of it is passed in no time
SLOWEST = 0.05  # of the mean pace: demonstrations that rest do not stop a path for ever
SHORTEST = 0.5  # of the motion: less of it is passed at constant pace


def share_of_path_at_time(
    demonstrated: Sequence[Float[np.ndarray, " pose"]], progress: Float[np.ndarray, " point"]
) -> Float[np.ndarray, " sample"]:
    """How much of a path is behind at evenly spaced times, if its progress is that of the demonstrations on average.

    Args:
        demonstrated: Progress of each demonstration at evenly spaced times.
        progress: Along the path, which may begin or end in the middle of the motion, or go backwards.
    """
    wanted = np.linspace(0, 1, SAMPLES)
    along = np.abs(np.diff(progress))
    if along.sum() < SHORTEST:
        return wanted
    mean = np.mean([np.interp(wanted, np.linspace(0, 1, len(one)), one) for one in demonstrated], axis=0)
    pace = np.interp((progress[1:] + progress[:-1]) / 2, mean, np.gradient(mean, wanted))
    spans = along / np.maximum(pace, SLOWEST) + LEAST / len(along)
    passed = np.concatenate([[0.0], np.cumsum(spans)])
    passed /= passed[-1]
    found = np.interp(wanted, passed, np.linspace(0, 1, len(progress)))
    found[0], found[-1] = 0.0, 1.0
    return np.maximum.accumulate(found)
