"""Where objects lay that were grasped and dropped, and where they were not."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from geomotion.figures.style import COLOUR, new_figure, paper_style, save_figure

WIDTH_MM, HEIGHT_MM = 110.0, 95.0
MARKS = {True: ("o", COLOUR["grid"], "in the bin"), False: ("x", COLOUR["expanding"], "failed")}


@paper_style()
def figure_episodes(rows: Sequence[Mapping[str, Any]], places_m: np.ndarray) -> Figure:
    """The table from above: places of the object when it was grasped, and the demonstrated ones."""
    figure = new_figure(WIDTH_MM, HEIGHT_MM)
    ax = figure.add_subplot()
    ax.plot(*places_m.T, "s", color=COLOUR["demonstration"], markersize=9, fillstyle="none", label="demonstrated place")
    for succeeded, (mark, colour, label) in MARKS.items():
        places = np.array([row["object_m"][:2] for row in rows if row["succeeded"] == succeeded]).reshape(-1, 2)
        aimed = np.array([row["aimed_m"][:2] for row in rows if row["succeeded"] == succeeded]).reshape(-1, 2)
        for place, aim in zip(places, aimed, strict=True):
            ax.plot(*np.stack([place, aim]).T, color=colour, linewidth=0.5)
        ax.plot(*places.T, mark, color=colour, markersize=3.5, label=f"{label}: {len(places)}")
    ax.set(xlabel=r"$x$ [m]", ylabel=r"$y$ [m]", aspect="equal")
    figure.legend(loc="outside lower center", ncols=3)
    return figure


def save_episodes_figure(rows: Sequence[Mapping[str, Any]], places_m: np.ndarray, folder: Path) -> list[str]:
    """Draw into `folder`; returns the names of the files."""
    data = {name: np.array([row[name] for row in rows]) for name in ("object_m", "aimed_m", "succeeded")}
    return save_figure(figure_episodes(rows, places_m), folder, "episodes", data | {"places_m": places_m})
