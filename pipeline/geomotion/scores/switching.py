"""How often a path changes from one group of demonstrations to another."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Int
from scipy.spatial import cKDTree

from geomotion.scores.paths import MotionPath


def nearest_groups(
    path: MotionPath, demonstrations: Sequence[MotionPath], groups: Sequence[int]
) -> Int[np.ndarray, " state"]:
    """Group of the demonstrated state that is nearest to each state of a path, as vectors."""
    states = np.concatenate([demo.vectors for demo in demonstrations])
    group_of_state = np.repeat(groups, [len(demo) for demo in demonstrations])
    _, nearest = cKDTree(states).query(path.vectors)
    return np.asarray(group_of_state[nearest])


def group_switches(path: MotionPath, demonstrations: Sequence[MotionPath], groups: Sequence[int]) -> int:
    """How many times the nearest group changes along a path.

    Source: Thesis Sec. 4.5, Fig. 4.5.
    """
    return int(np.count_nonzero(np.diff(nearest_groups(path, demonstrations, groups))))
