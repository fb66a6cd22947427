"""Pictures of recordings: paths in a plane, projections of paths in space, coordinates over time."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from geomotion.demos.columns import column_names
from geomotion.demos.demonstrations import CHANNEL_UNITS, Demonstrations
from geomotion.figures.style import COLOUR, new_figure, paper_style

COLUMNS = 4
PROJECTIONS = ((0, 1), (0, 2), (1, 2))
LINE_STYLES = {False: "-", True: ":"}  # by whether a demonstration is held out


def draw_paths(
    ax: Axes, demonstrations: Demonstrations, plane: tuple[int, int] = (0, 1), held_out: Collection[int] = ()
) -> Axes:
    """Draw positions projected to a plane: start as circle, end as star, held-out demonstrations dotted."""
    for number, trajectory in enumerate(demonstrations.trajectories):
        path = trajectory.channels["position_m"][:, plane]
        style = LINE_STYLES[number in held_out]
        ax.plot(*path.T, color=COLOUR["demonstration"], linestyle=style, linewidth=0.9, zorder=2)
        ax.plot(*path[0], "o", color=COLOUR["rollout"], mec="black", mew=0.5, markersize=4, zorder=3)
        ax.plot(*path[-1], "*", color="white", mec="black", mew=0.7, markersize=9, zorder=4)
    names = [_axis_label("position_m", axis, demonstrations) for axis in plane]
    ax.set(xlabel=names[0], ylabel=names[1], aspect="equal")
    ax.xaxis.set_major_locator(MaxNLocator(nbins=5))
    ax.yaxis.set_major_locator(MaxNLocator(nbins=5))
    return ax


def draw_axis(ax: Axes, demonstrations: Demonstrations, channel: str, axis: int, held_out: Collection[int] = ()) -> Axes:
    """Draw one axis of a channel over time, held-out demonstrations dotted."""
    for number, trajectory in enumerate(demonstrations.trajectories):
        style = LINE_STYLES[number in held_out]
        values = trajectory.channels[channel][:, axis]
        ax.plot(trajectory.time_s, values, color=COLOUR["demonstration"], linestyle=style, linewidth=0.7)
    ax.set(xlabel="time [s]", ylabel=_axis_label(channel, axis, demonstrations))
    ax.margins(x=0.01)
    return ax


@paper_style()
def figure_demonstrations(
    demonstrations: Demonstrations, channels: Sequence[str] | None = None, held_out: Collection[int] = ()
) -> Figure:
    """Paths for planar positions; otherwise every axis over time, with projections of positions in space.

    Args:
        demonstrations: What to draw.
        channels: Channels to draw; all but velocities if omitted.
        held_out: Numbers of the demonstrations that are not trained on.
    """
    if channels is None:
        channels = [name for name in demonstrations.channel_names if "_per_s" not in name]
    widths = {name: demonstrations[0].channels[name].shape[1] for name in channels}
    if widths == {"position_m": 2}:
        figure = new_figure(width_mm=85, height_mm=85)
        draw_paths(figure.add_subplot(), demonstrations, held_out=held_out)
    else:
        figure = _small_multiples(demonstrations, widths, held_out)
    _legend(figure, any(number in held_out for number in range(len(demonstrations))), "position_m" in widths)
    return figure


def figure_data(demonstrations: Demonstrations) -> dict[str, NDArray[np.float64]]:
    """The arrays behind the picture: ``demo_<i>_<channel>`` and ``demo_<i>_time_s``."""
    arrays: dict[str, NDArray[np.float64]] = {}
    for number, trajectory in enumerate(demonstrations.trajectories):
        arrays[f"demo_{number}_time_s"] = trajectory.time_s
        arrays |= {f"demo_{number}_{name}": values for name, values in trajectory.channels.items()}
    return arrays


def _small_multiples(demonstrations: Demonstrations, widths: Mapping[str, int], held_out: Collection[int]) -> Figure:
    planes = PROJECTIONS if widths.get("position_m") == 3 else ()
    axes = [(channel, axis) for channel, width in widths.items() for axis in range(width)]
    time_rows = -(-len(axes) // COLUMNS)
    figure = new_figure(width_mm=175, height_mm=12 + 34 * time_rows + 58 * bool(planes))
    top, bottom = figure.subfigures(2, 1, height_ratios=[58, 34 * time_rows]) if planes else (None, figure)
    if top is not None:
        for ax, plane in zip(top.subplots(1, len(planes)), planes, strict=True):
            draw_paths(ax, demonstrations, plane, held_out)
    cells = bottom.subplots(time_rows, min(COLUMNS, len(axes)), squeeze=False, sharex=True).flat
    for cell, (channel, axis) in zip(cells, axes, strict=False):
        draw_axis(cell, demonstrations, channel, axis, held_out).label_outer()
    for cell in list(cells)[len(axes) :]:
        cell.set_axis_off()
    return figure


def _axis_label(channel: str, axis: int, demonstrations: Demonstrations) -> str:
    name = column_names(channel, demonstrations[0].channels[channel].shape[1])[axis]
    short = {"position_m": "", "orientation_wxyz": "q", "joints_rad": "joint "}.get(channel, "")
    return f"{short}{name.removesuffix('_rad').rsplit('_', 1)[-1]} [{CHANNEL_UNITS[channel]}]"


def _legend(figure: Figure, has_held_out: bool, has_markers: bool) -> None:
    black = COLOUR["demonstration"]
    handles = [Line2D([], [], color=black, label="demonstration")]
    if has_held_out:
        handles.append(Line2D([], [], color=black, linestyle=LINE_STYLES[True], label="held out"))
    if has_markers:
        handles.append(Line2D([], [], marker="o", color=COLOUR["rollout"], mec="black", markersize=4, linestyle="", label="start"))
        handles.append(Line2D([], [], marker="*", color="white", mec="black", markersize=8, linestyle="", label="end"))
    figure.legend(handles=handles, loc="outside upper center", ncols=4)
