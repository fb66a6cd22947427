"""One geodesic found by several methods, in latent space (Fig. 3.3)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from geomotion.figures.latent import LatentMaps, draw_latent, legend_handles
from geomotion.figures.style import COLOUR, SEQUENCE, new_figure, paper_style, save_figure

STYLES = {
    "straight_line": (COLOUR["euclidean"], "--"),
    "graph_50": (SEQUENCE[5], "-"),
    "graph_100": (COLOUR["riemannian"], "-"),
    "gradient_from_line": (SEQUENCE[1], "-."),
    "gradient_from_graph": (SEQUENCE[4], ":"),
}


@dataclass(frozen=True)
class MethodCurve:
    """A curve and what it cost.

    Attributes:
        name: Of the method.
        codes: Latent points.
        length: Riemannian length.
        seconds: Computing time [s].
    """

    name: str
    codes: Float[np.ndarray, "point d"]
    length: float
    seconds: float


@paper_style()
def figure_methods(curves: list[MethodCurve], maps: LatentMaps) -> Figure:
    """All curves over the magnification factor; the legend gives lengths and times."""
    figure = new_figure(width_mm=130, height_mm=105)
    ax = draw_latent(figure.add_subplot(), maps, "log_magnification")
    for curve in curves:
        colour, style = STYLES[curve.name]
        label = f"{curve.name.replace('_', ' ')}: length {curve.length:.2f}, {curve.seconds:.2f} s"
        ax.plot(*curve.codes.T, color=colour, linestyle=style, linewidth=1.6, label=label, zorder=5)
    handles = [*ax.get_lines()[-len(curves) :], *legend_handles(maps)]
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure


def save_methods_figure(curves: list[MethodCurve], maps: LatentMaps, folder: Path) -> list[str]:
    """Draw into `folder`; returns the names of the files."""
    return save_figure(figure_methods(curves, maps), folder, "methods", {one.name: one.codes for one in curves})
