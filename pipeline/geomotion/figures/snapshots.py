"""Examples of pictures that conditions are learned from."""

from collections.abc import Mapping
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from matplotlib.figure import Figure

from geomotion.figures.style import new_figure, paper_style, save_figure

COLUMNS, SIDE_MM = 8, 20.0


@runtime_checkable
class LabelledPictures(Protocol):
    """Pictures, and which place each is of; -1 for anywhere between."""

    @property
    def pictures(self) -> np.ndarray:
        """Shape (picture, height, width, 3)."""
        ...

    @property
    def place(self) -> np.ndarray:
        """Shape (picture,)."""
        ...


@paper_style()
def figure_snapshots(taken: Mapping[str, LabelledPictures]) -> Figure:
    """Two rows for each skill: pictures of the places in turn, and of objects between them."""
    rows = [
        (f"before the {name}, {where}", chosen)
        for name, one in taken.items()
        for where, chosen in _examples(one).items()
    ]
    figure = new_figure(COLUMNS * SIDE_MM, len(rows) * (SIDE_MM + 2))
    axes = figure.subplots(len(rows), COLUMNS, squeeze=False)
    for line, (title, chosen) in zip(axes, rows, strict=True):
        for ax in line:
            ax.set_axis_off()
        for ax, picture in zip(line, chosen, strict=False):
            ax.imshow(picture)
        line[0].set_title(title, loc="left")
    return figure


def save_snapshots_figure(taken: Mapping[str, LabelledPictures], folder: Path) -> list[str]:
    """Draw into `folder`; returns the names of the files."""
    data = {
        f"{name}_{where}".replace(" ", "_"): chosen
        for name, one in taken.items()
        for where, chosen in _examples(one).items()
    }
    return save_figure(figure_snapshots(taken), folder, "snapshots", data)


def _examples(taken: LabelledPictures) -> dict[str, np.ndarray]:
    kinds = {"at the places": taken.place >= 0, "between": taken.place < 0}
    return {where: taken.pictures[rows][:COLUMNS] for where, rows in kinds.items() if rows.any()}
