"""Whether trajectories that start close together come closer (Fig. 6.6)."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from geomotion.figures.arrays import Array, EvaluationArrays, Nearby
from geomotion.figures.style import COLOUR, new_figure, paper_style


def relative(distance: Array, initial: float | None = None) -> Array:
    """Distances as multiples of the first one, or of `initial`; NaN where a logarithm has nothing to show."""
    reference = distance[0] if initial is None else initial
    return np.where((distance > 0) & np.isfinite(distance), distance, np.nan) / reference


def draw_nearby(ax: Axes, nearby: Nearby, rate_per_s: float | None = None) -> Axes:
    """Draw mean pairwise distances relative to the first one, so that both metrics share an axis.

    Args:
        ax: Where to draw.
        nearby: Distances over time.
        rate_per_s: Proven contraction rate [1/s], named in the legend.
    """
    label = f"Euclidean (from {nearby.euclidean[0]:.2g} m)"
    ax.plot(nearby.time_s, relative(nearby.euclidean), color=COLOUR["euclidean"], linestyle="-.", label=label)
    if not np.allclose(relative(nearby.euclidean), relative(nearby.claimed), equal_nan=True):
        ax.plot(nearby.time_s, relative(nearby.claimed), color=COLOUR["riemannian"], label="claimed metric")
    if nearby.bound is not None:
        rate = "" if rate_per_s is None else rf" $e^{{-\tau t}}$, $\tau$ = {rate_per_s:.2g} 1/s"
        bound = relative(nearby.bound, nearby.claimed[0])
        ax.plot(nearby.time_s, bound, color=COLOUR["riemannian"], linestyle="--", label=f"proven bound{rate}")
    ax.axhline(1.0, color=COLOUR["field"], linewidth=0.8, zorder=0)
    ax.set_yscale("log")
    ax.set(xlabel="time [s]", ylabel="distance / initial distance [1]")
    ax.margins(x=0.01)
    ax.legend(loc="best")
    return ax


@paper_style()
def figure_nearby(data: EvaluationArrays, rate_per_s: float | None = None) -> Figure:
    """Distances between nearby trajectories over time. `data.nearby` has to be present."""
    assert data.nearby is not None
    figure = new_figure(width_mm=120, height_mm=75)
    draw_nearby(figure.add_subplot(), data.nearby, rate_per_s)
    return figure
