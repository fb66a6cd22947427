"""How the distance between nearby rollouts evolves with each method (Fig. 6.6)."""

from collections.abc import Sequence
from itertools import chain

from matplotlib.axes import Axes

from geomotion.figures.arrays import Array, Nearby, read_evaluation
from geomotion.figures.nearby import relative
from geomotion.figures.studies.panels import JudgedCell, StudyFigure, named_arrays, of_first_seed
from geomotion.figures.style import new_figure, paper_style

PANEL_MM = 62
LEGEND_MM = 44
TITLES = ("Euclidean distance", "distance in the coordinates of the chart")


@paper_style()
def nearby(cells: Sequence[JudgedCell]) -> StudyFigure | None:
    """Mean distance over pairs, relative to the first one: a row for each dataset, a column for each metric."""
    found = [
        (cell, data)
        for cell in of_first_seed(cells)
        if (data := read_evaluation(cell.folder / "evaluation.npz").nearby) is not None
    ]
    if not found:
        return None
    datasets = list(dict.fromkeys(cell.dataset for cell, _ in found))
    variants = list(dict.fromkeys(cell.variant for cell, _ in found))
    figure = new_figure(2 * PANEL_MM + LEGEND_MM, len(datasets) * (PANEL_MM - 8) + 12)
    grid = figure.subplots(len(datasets), 2, squeeze=False)
    for row, dataset in zip(grid, datasets, strict=True):
        for cell, data in found:
            if cell.dataset == dataset:
                colour = f"C{variants.index(cell.variant)}"
                for ax, distance in zip(row, (data.euclidean, data.claimed), strict=True):
                    _draw(ax, data, distance, cell.variant, colour)
        for ax, title in zip(row, TITLES, strict=True):
            ax.set_title(f"{dataset}\n{title}")
        row[0].set_ylabel("distance / initial distance [1]")
    for ax in grid[-1]:
        ax.set_xlabel("share of the duration [1]")
    lines = {str(line.get_label()): line for line in chain.from_iterable(ax.lines for ax in grid[:, 0])}
    grid[0, -1].legend(handles=[lines[name] for name in variants], loc="upper left", bbox_to_anchor=(1.02, 1.0))
    arrays = [{"time_s": data.time_s, "euclidean": data.euclidean, "claimed": data.claimed} for _, data in found]
    caption = (
        "Mean distance between all pairs of rollouts from nearby starts, first seed. A contracting field lowers it at "
        "every time in the metric in which it contracts; in another metric it may rise on the way."
    )
    data_by_cell = named_arrays([cell for cell, _ in found], arrays)
    return StudyFigure(figure, "Distance between nearby rollouts", caption, data_by_cell)


def _draw(ax: Axes, data: Nearby, distance: Array, label: str, colour: str) -> None:
    ax.plot(data.time_s / data.time_s[-1], relative(distance), color=colour, label=label)
    ax.axhline(1.0, color="0.6", linewidth=0.8, zorder=0)
    ax.set_yscale("log")
