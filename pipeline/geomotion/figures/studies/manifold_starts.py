"""Motions that start beside the manifold of a skill, as each method leads them to it (Fig. 6.10)."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from geomotion.figures.studies.panels import JudgedCell, StudyFigure, named_arrays, of_first_seed
from geomotion.figures.style import COLOUR, new_figure, paper_style

PANEL_MM = 62
LEGEND_MM = 14
START, ARRIVAL, LEADING = "#B2182B", "#1B7837", "#E08214"
PREFIX = "off_manifold_"
CAPTION = (
    "Above, the first two coordinates of motions from starts beside the manifold of the skill (red). A decoded skill "
    "is led to it first (dashed, to the green dots) and followed then; an embedded one is followed at once. Below, the "
    "distance to the manifold; dotted, a decoded skill without the transition phase (Algorithm 2)."
)


@paper_style()
def manifold_starts(cells: Sequence[JudgedCell]) -> StudyFigure | None:
    """Paths, and distances to the manifold over time: a column for each dataset and variant."""
    found = [(cell, data) for cell in of_first_seed(cells) if (data := _read(cell)) is not None]
    if not found:
        return None
    figure = new_figure(len(found) * PANEL_MM + 8, 2 * PANEL_MM + LEGEND_MM)
    above, below = figure.subplots(2, len(found), squeeze=False, sharey="row")
    for paths, distances, (cell, data) in zip(above, below, found, strict=True):
        _draw_paths(paths, data)
        _draw_distances(distances, data)
        paths.set_title(f"{cell.dataset}\n{cell.variant}")
    below[0].set_ylim(bottom=0)  # of all, which share it
    above[0].set_ylabel("$x_2$ [m]")
    below[0].set_ylabel("distance to the manifold [mm]")
    figure.legend(handles=_legend(), loc="outside lower center", ncols=3)
    arrays = named_arrays([cell for cell, _ in found], [data for _, data in found])
    return StudyFigure(figure, "Starts beside the manifold", CAPTION, arrays)


def _read(cell: JudgedCell) -> Mapping[str, np.ndarray] | None:
    with np.load(cell.folder / "evaluation.npz", allow_pickle=False) as stored:
        names = [name for name in stored.files if name.startswith(PREFIX)]
        return {name.removeprefix(PREFIX): stored[name] for name in names} or None


def _draw_paths(ax: Axes, data: Mapping[str, np.ndarray]) -> None:
    is_led = data["time_s"] < data["transition_s"]
    arrives = int(is_led.sum())
    for states in data["states"]:
        ax.plot(*states[: arrives + 1, :2].T, "--", color=LEADING, linewidth=1.0)
        ax.plot(*states[arrives:, :2].T, color=COLOUR["rollout"], linewidth=0.9)
        if arrives:
            ax.plot(*states[arrives, :2], "o", color=ARRIVAL, markersize=3)
        ax.plot(*states[0, :2], "o", color=START, markersize=3)
    ax.set(xlabel="$x_1$ [m]", aspect="equal")


def _draw_distances(ax: Axes, data: Mapping[str, np.ndarray]) -> None:
    share = data["time_s"] / data["time_s"][-1]
    ax.plot(share, 1000 * data["away"].T, color=COLOUR["rollout"], linewidth=0.9)
    if data["transition_s"] > 0:
        ax.plot(share, 1000 * data["uncorrected_away"].T, ":", color=COLOUR["euclidean"], linewidth=0.9)
    ax.set_xlabel("share of the duration [1]")


def _legend() -> list[Line2D]:
    return [
        Line2D([], [], marker="o", linestyle="", color=START, markersize=3, label="start"),
        Line2D([], [], linestyle="--", color=LEADING, label="transition phase"),
        Line2D([], [], marker="o", linestyle="", color=ARRIVAL, markersize=3, label="on the manifold"),
        Line2D([], [], color=COLOUR["rollout"], label="followed"),
        Line2D([], [], linestyle=":", color=COLOUR["euclidean"], label="without the transition phase"),
    ]
