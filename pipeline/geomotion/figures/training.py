"""Training curves."""

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from geomotion.figures.style import COLOUR, SEQUENCE, new_figure, paper_style, save_figure

NOT_LOSSES = ("step", "total", "learning_rate")


def loss_terms(curves: pd.DataFrame) -> list[str]:
    """Names of the terms that make up the total."""
    return [str(name) for name in curves.columns if name not in NOT_LOSSES]


def draw_losses(ax: Axes, curves: pd.DataFrame) -> Axes:
    """Draw the total and its terms; a term that can be negative makes the axis linear around zero."""
    terms = loss_terms(curves)
    for number, name in enumerate(terms):
        colour, style = SEQUENCE[number % len(SEQUENCE)], ("--", "-.", ":")[number % 3]
        ax.plot(curves["step"], curves[name], color=colour, linestyle=style, linewidth=1, label=name.replace("_", " "))
    ax.plot(curves["step"], curves["total"], color=COLOUR["demonstration"], linewidth=1.4, label="total")
    values = curves[["total", *terms]].to_numpy(dtype=float)
    if (values < 0).any():
        ax.set_yscale("symlog", linthresh=float(np.percentile(np.abs(values[values != 0]), 10)))
    elif (values > 0).any():
        ax.set_yscale("log")
    ax.set_ylabel("loss [1]")
    ax.legend(loc="upper right")
    return ax


def draw_learning_rate(ax: Axes, curves: pd.DataFrame) -> Axes:
    """Draw the learning rate."""
    ax.plot(curves["step"], curves["learning_rate"], color=COLOUR["euclidean"], linewidth=1)
    ax.set(xlabel="optimiser step [1]", ylabel="learning rate [1]", ylim=(0, None))
    return ax


@paper_style()
def figure_training(curves: pd.DataFrame) -> Figure:
    """Losses above, learning rate below.

    Args:
        curves: Columns step, total, each loss term, learning_rate.
    """
    figure = new_figure(width_mm=120, height_mm=90)
    losses, rate = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    draw_losses(losses, curves)
    draw_learning_rate(rate, curves)
    losses.margins(x=0.01)
    return figure


def save_training_figure(curves: pd.DataFrame, folder: Path) -> list[str]:
    """Draw the curves into `folder`; returns the names of the files."""
    columns = {str(name): curves[name].to_numpy() for name in curves.columns}
    return save_figure(figure_training(curves), folder, "training", columns)
