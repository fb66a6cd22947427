"""A policy in its safety region on the simulated robot: ways in the latent plane, and how near the border they come."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from geomotion.figures.latent import label_latent
from geomotion.figures.policy_replay import PUSHED
from geomotion.figures.safety import draw_region
from geomotion.figures.style import COLOUR, limit_to, new_figure, paper_style, save_figure

WIDTH_MM, HEIGHT_MM = 120.0, 125.0


@dataclass(frozen=True)
class Trace:
    """One executed motion.

    Attributes:
        time_s: [s].
        codes: Latent points.
        border_m: Distance to the border of the region, negative outside [m].
    """

    time_s: Float[np.ndarray, " time"]
    codes: Float[np.ndarray, "time 2"]
    border_m: Float[np.ndarray, " time"]


@dataclass(frozen=True)
class RegionPicture:
    """What there is to see of motions in a region and without it.

    Attributes:
        axes: Grid coordinates along both latent axes.
        distance: S.
        levels: ρ, ν and k.
        is_inside: Nodes whose position is in an obstacle.
        codes: Encoded demonstrations.
        goal: Latent point.
        undisturbed: Latent path in the region without anything that disturbs.
        led: Executed in the region.
        free: Executed as it was learned.
        pushes_s: Beginning and end of each push.
    """

    axes: Float[np.ndarray, "2 n"]
    distance: Float[np.ndarray, "n n"]
    levels: Float[np.ndarray, " 3"]
    is_inside: Bool[np.ndarray, "n n"]
    codes: Sequence[Float[np.ndarray, "_ 2"]]
    goal: Float[np.ndarray, " 2"]
    undisturbed: Float[np.ndarray, "_ 2"]
    led: Trace
    free: Trace
    pushes_s: Sequence[tuple[float, float]]


@paper_style()
def figure_policy_region(picture: RegionPicture) -> Figure:
    """The latent plane, and below it the distance to the border over time."""
    figure = new_figure(WIDTH_MM, HEIGHT_MM)
    plane, border = figure.subplots(2, 1, height_ratios=[1.2, 1])
    draw_region(figure, plane, picture)
    _draw_ways(plane, picture)
    _draw_border(border, picture)
    figure.legend(*plane.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def save_policy_region_figure(picture: RegionPicture, folder: Path) -> list[str]:
    """Write the figure, and the numbers behind it."""
    behind = {
        "axes": picture.axes,
        "distance": picture.distance,
        "undisturbed": picture.undisturbed,
        "pushes_s": np.array(picture.pushes_s).reshape(-1, 2),
    }
    for name, trace in (("led", picture.led), ("free", picture.free)):
        behind |= {f"{name}_time_s": trace.time_s, f"{name}_codes": trace.codes, f"{name}_border_m": trace.border_m}
    return save_figure(figure_policy_region(picture), folder, "closed_loop_region", behind)


def _draw_ways(ax: Axes, picture: RegionPicture) -> None:
    for number, one in enumerate(picture.codes):
        label = None if number else "demonstrations"
        ax.plot(*one.T, color=COLOUR["demonstration"], linewidth=0.6, label=label, zorder=2.5)
    ax.plot(*picture.free.codes.T, color=COLOUR["euclidean"], linewidth=1.2, label="executed without it", zorder=3)
    ax.plot(*picture.undisturbed.T, "--", color="black", linewidth=0.9, label="undisturbed in the region", zorder=4)
    ax.plot(*picture.led.codes.T, color=COLOUR["rollout"], linewidth=1.4, label="executed in the region", zorder=3.5)
    for number, (begin_s, end_s) in enumerate(picture.pushes_s):
        first, last = np.searchsorted(picture.led.time_s, [begin_s, end_s])
        pushed = picture.led.codes[max(first - 1, 0) : last + 1]
        ax.plot(*pushed.T, color=PUSHED, linewidth=2.2, label=None if number else "pushed", zorder=4.5)
    ax.plot(*picture.goal, "*", color="white", mec="black", mew=0.7, markersize=9, zorder=5)
    label_latent(ax)
    limit_to(ax, np.concatenate([*picture.codes, picture.led.codes, picture.free.codes]))


def _draw_border(ax: Axes, picture: RegionPicture) -> None:
    for trace, colour in ((picture.free, COLOUR["euclidean"]), (picture.led, COLOUR["rollout"])):
        ax.plot(trace.time_s, 1000 * trace.border_m, color=colour)
    ax.axhline(0, color=COLOUR["obstacle"], linewidth=1.0)
    for begin_s, end_s in picture.pushes_s:
        ax.axvspan(begin_s, end_s, color=PUSHED, alpha=0.25, linewidth=0.8)
    ax.set(xlabel="time [s]", ylabel="inside the border [mm]")
    ax.margins(x=0.01)
