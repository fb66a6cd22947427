"""Motions of a skill of few dimensions in its latent space (Fig. 6.15)."""

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from geomotion.figures.arrays import EvaluationArrays, Flow, LatentPlane
from geomotion.figures.motion import draw_flow
from geomotion.figures.style import COLOUR, new_figure, paper_style

EVERY = 8  # point of a demonstration is drawn
DOT: dict[str, Any] = {"marker": "o", "markersize": 2, "linestyle": "", "color": COLOUR["demonstration"]}
START: dict[str, Any] = {"marker": "o", "markersize": 3, "linestyle": "", "color": COLOUR["grid"]}


def draw_latent_paths(ax: Axes, plane: LatentPlane) -> Axes:
    """Draw the latent field, the encoded demonstration as dots, the motion from its start and those from elsewhere."""
    draw_flow(ax, Flow(plane.points, plane.velocity))
    own, *others = plane.paths
    for path in others:
        ax.plot(*path.T, color=COLOUR["grid"], linewidth=0.7, zorder=2)
        ax.plot(*path[0], **START, zorder=2)
    ax.plot(*own.T, color=COLOUR["rollout"], zorder=3)
    ax.plot(*plane.demonstrated[::EVERY].T, **DOT, zorder=4)
    ax.plot(0, 0, "*", color="white", mec="black", mew=0.8, markersize=10, zorder=5)
    ax.set(xlabel="skill coordinate $z_1$", ylabel="$z_2$" if plane.is_skill[1] else "beside the skill's manifold")
    ax.margins(0)
    return ax


@paper_style()
def figure_latent_paths(data: EvaluationArrays) -> Figure:
    """The latent plane of a skill, with a legend."""
    assert data.latent is not None
    figure = new_figure(width_mm=110, height_mm=90)
    draw_latent_paths(figure.add_subplot(), data.latent)
    handles = [
        Line2D([], [], **DOT, label="demonstration"),
        Line2D([], [], color=COLOUR["rollout"], label="motion from its start"),
        Line2D([], [], color=COLOUR["grid"], label="from elsewhere"),
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure
