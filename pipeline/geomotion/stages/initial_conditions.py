"""Where the methods of a study were started from: the same states for every one, or it is said."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from geomotion.stages.study_cells import Cell
from geomotion.types import Float

STARTS = ("goal_starts", "nearby_starts")
PATHS = ("demo_", "region_rollouts")  # arrays of trajectories, whose first states are starts
SAME = 1e-3  # of the extent: a chart there and back, or a plan, begins only nearly where it was told to

Arrays = dict[str, Float[np.ndarray, "start D"]]


def initial_conditions(judged: Sequence[tuple[Cell, Path]]) -> tuple[Arrays, list[str]]:
    """The states that rollouts of each dataset and seed began at, and which cells began at others.

    Args:
        judged: Cells with the folders of their evaluations.
    """
    kept: dict[str, Arrays] = {}
    differing = []
    for cell, folder in judged:
        own = dict(_starts(folder / "evaluation.npz"))
        first = kept.setdefault(f"{cell.dataset}, seed {cell.seed}", own)
        common = first.keys() & own.keys()
        if not all(_are_same(first[name], own[name]) for name in common):
            differing.append(f"{cell.name}: judged from other starts than the first method there")
        first.update({name: starts for name, starts in own.items() if name not in first})
    return {f"{place}/{name}": starts for place, own in kept.items() for name, starts in own.items()}, differing


def _are_same(one: Float[np.ndarray, "start D"], other: Float[np.ndarray, "other_start other_D"]) -> bool:
    return one.shape == other.shape and bool(np.abs(one - other).max() <= SAME * np.ptp(one, axis=0).max())


def _starts(path: Path) -> Iterator[tuple[str, Float[np.ndarray, "start D"]]]:
    with np.load(path, allow_pickle=False) as archive:
        for name in archive.files:
            if name in STARTS:
                yield name, archive[name]
            elif name.startswith(PATHS) and archive[name].size:
                yield name, archive[name][..., :1, :].reshape(-1, archive[name].shape[-1])
