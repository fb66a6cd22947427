"""The demonstrations' own timing for a planned path."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

SAMPLES = 60
LEAST = 1e-3  # share of the mean pace: a path never stands still between its ends


def share_of_path_at_time(
    demonstrated: Sequence[Float[np.ndarray, " pose"]], progress: Float[np.ndarray, " point"]
) -> Float[np.ndarray, " sample"]:
    """How much of a path is behind at evenly spaced times, if its progress is that of the demonstrations on average.

    Args:
        demonstrated: Progress of each demonstration at evenly spaced times.
        progress: Along the path, which may begin or end in the middle of the motion, or go backwards.
    """
    wanted = np.linspace(0, 1, SAMPLES)
    shares = [np.interp(wanted, np.linspace(0, 1, len(one)), one) for one in demonstrated]
    pace = np.gradient(np.mean(shares, axis=0), wanted)
    along = np.abs(np.diff(progress))
    if along.sum() < 0.5:  # little of the motion: at constant pace
        return wanted
    at = np.interp((progress[1:] + progress[:-1]) / 2, np.mean(shares, axis=0), pace)
    spans = along / np.maximum(at, 0.05) + LEAST / len(along)
    passed = np.concatenate([[0.0], np.cumsum(spans)])
    passed /= passed[-1]
    found = np.interp(wanted, passed, np.linspace(0, 1, len(progress)))
    found[0], found[-1] = 0.0, 1.0
    return np.maximum.accumulate(found)
