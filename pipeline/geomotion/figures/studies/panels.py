"""What a study draws: one panel for each variant on each dataset."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from geomotion.figures.style import new_figure

MOST_COLUMNS = 6  # of one dataset; several have a row each
TITLE_MM = 8
LABELS_MM = 14  # what tick labels and the label of an axis need


@dataclass(frozen=True)
class JudgedCell:
    """An evaluated run of a study: what was varied, and the folder of its evaluation."""

    dataset: str
    variant: str
    seed: int
    folder: Path


@dataclass(frozen=True)
class StudyFigure:
    """A picture, what to look for in it, and the numbers behind it."""

    figure: Figure
    title: str
    caption: str
    data: Mapping[str, ArrayLike]


DrawStudy = Callable[[Sequence[JudgedCell]], StudyFigure | None]
"""Draws what applies to some of the cells; None where nothing does."""


def of_first_seed(cells: Sequence[JudgedCell]) -> list[JudgedCell]:
    """One cell for each dataset and variant."""
    first: dict[tuple[str, str], JudgedCell] = {}
    for cell in cells:
        first.setdefault((cell.dataset, cell.variant), cell)
    return list(first.values())


def panel_grid(cells: Sequence[JudgedCell], side_mm: float | int) -> tuple[Figure, list[Axes]]:
    """A figure with axes for each cell in turn: datasets in rows, variants in columns.

    Args:
        cells: One for each dataset and variant.
        side_mm: Side of a panel [mm].
    """
    datasets = list(dict.fromkeys(cell.dataset for cell in cells))
    variants = list(dict.fromkeys(cell.variant for cell in cells))
    if len(datasets) == 1:
        columns = min(len(cells), MOST_COLUMNS)
        places = [divmod(number, columns) for number in range(len(cells))]
    else:
        columns = len(variants)
        places = [(datasets.index(cell.dataset), variants.index(cell.variant)) for cell in cells]
    rows = 1 + max(row for row, _ in places)
    figure = new_figure(columns * side_mm + LABELS_MM, rows * (side_mm + TITLE_MM) + LABELS_MM)
    grid = figure.subplots(rows, columns, squeeze=False)
    for ax in grid.flat:
        ax.set_axis_off()
    chosen = [grid[place] for place in places]
    for ax, cell in zip(chosen, cells, strict=True):
        ax.set_axis_on()
        ax.set_title(f"{cell.dataset}\n{cell.variant}" if len(datasets) > 1 else cell.variant)
    return figure, chosen


def named_arrays(cells: Sequence[JudgedCell], arrays: Sequence[Mapping[str, ArrayLike]]) -> dict[str, ArrayLike]:
    """Arrays of every cell under its number, with ``cell_<number>`` saying which one that is."""
    data: dict[str, ArrayLike] = {}
    for number, (cell, own) in enumerate(zip(cells, arrays, strict=True)):
        data[f"cell_{number}"] = np.array(f"{cell.dataset}: {cell.variant}, seed {cell.seed}")
        data |= {f"{name}_{number}": values for name, values in own.items()}
    return data
