"""Pictures of recordings: paths in a plane, projections of paths in space, coordinates over time."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from geomotion.demos.columns import column_names
from geomotion.demos.demonstrations import CHANNEL_UNITS, VELOCITY_OF, Demonstrations
from geomotion.figures.style import COLOUR, new_figure, paper_style, state_label

COLUMNS = 4
LEGEND_MM, PATHS_MM, ROW_MM = 12.0, 58.0, 34.0
PROJECTIONS = ((0, 1), (0, 2), (1, 2))
START: dict[str, Any] = {"marker": "o", "color": COLOUR["rollout"], "mec": "black", "mew": 0.5, "markersize": 4}
END: dict[str, Any] = {"marker": "*", "color": "white", "mec": "black", "mew": 0.7, "markersize": 9}


def draw_paths(
    ax: Axes, demonstrations: Demonstrations, plane: tuple[int, int] = (0, 1), held_out: Collection[int] = ()
) -> Axes:
    """Draw positions projected to a plane: start as circle, end as star, held-out demonstrations dotted."""
    for number, trajectory in enumerate(demonstrations.trajectories):
        path = trajectory.channels["position_m"][:, plane]
        style = ":" if number in held_out else "-"
        ax.plot(*path.T, color=COLOUR["demonstration"], linestyle=style, linewidth=0.9, zorder=2)
        ax.plot(*path[0], **START, zorder=3)
        ax.plot(*path[-1], **END, zorder=4)
    names = [_axis_label("position_m", axis, demonstrations) for axis in plane]
    ax.set(xlabel=names[0], ylabel=names[1])
    ax.set_aspect("equal", adjustable="datalim")
    for direction in (ax.xaxis, ax.yaxis):
        direction.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 5, 10]))
    return ax


def draw_axis(
    ax: Axes, demonstrations: Demonstrations, channel: str, axis: int, held_out: Collection[int] = ()
) -> Axes:
    """Draw one axis of a channel over time, held-out demonstrations dotted."""
    for number, trajectory in enumerate(demonstrations.trajectories):
        style = ":" if number in held_out else "-"
        values = trajectory.channels[channel][:, axis]
        ax.plot(trajectory.time_s, values, color=COLOUR["demonstration"], linestyle=style, linewidth=0.7)
    ax.set(ylabel=_axis_label(channel, axis, demonstrations))
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
        channels = [name for name in demonstrations.channel_names if name not in VELOCITY_OF.values()]
    widths = {name: demonstrations[0].channels[name].shape[1] for name in channels}
    if widths == {"position_m": 2}:
        figure = new_figure(width_mm=85, height_mm=85)
        draw_paths(figure.add_subplot(), demonstrations, held_out=held_out)
    else:
        figure = _small_multiples(demonstrations, widths, held_out)
    has_held_out = any(number in held_out for number in range(len(demonstrations)))
    _legend(figure, has_held_out, has_paths=widths.get("position_m") in (2, 3))
    return figure


def figure_data(demonstrations: Demonstrations) -> dict[str, NDArray[np.float64]]:
    """The arrays behind the picture: ``demo_<i>_<channel>`` and ``demo_<i>_time_s``."""
    arrays: dict[str, NDArray[np.float64]] = {}
    for number, trajectory in enumerate(demonstrations.trajectories):
        arrays[f"demo_{number}_time_s"] = trajectory.time_s
        arrays |= {f"demo_{number}_{name}": values for name, values in trajectory.channels.items()}
    return arrays


def _small_multiples(demonstrations: Demonstrations, widths: Mapping[str, int], held_out: Collection[int]) -> Figure:
    """Every axis over time; above it, where positions are planar or spatial, the paths."""
    planes = {2: PROJECTIONS[:1], 3: PROJECTIONS}.get(widths.get("position_m", 0), ())
    axes = [(channel, axis) for channel, width in widths.items() for axis in range(width)]
    rows = -(-len(axes) // COLUMNS)
    heights = [PATHS_MM] * bool(planes) + [ROW_MM * rows]
    figure = new_figure(width_mm=175, height_mm=LEGEND_MM + sum(heights))
    *above, below = figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
    for part in above:
        for ax, plane in zip(part.subplots(1, len(planes), squeeze=False)[0], planes, strict=True):
            draw_paths(ax, demonstrations, plane, held_out)
    cells = below.subplots(rows, min(COLUMNS, len(axes)), squeeze=False).flatten()
    for cell, (channel, axis) in zip(cells, axes, strict=False):
        draw_axis(cell, demonstrations, channel, axis, held_out)
    for cell in cells[max(0, len(axes) - COLUMNS) : len(axes)]:
        cell.set_xlabel("time [s]")
    for cell in cells[len(axes) :]:
        cell.set_axis_off()
    return figure


def _axis_label(channel: str, axis: int, demonstrations: Demonstrations) -> str:
    width = demonstrations[0].channels[channel].shape[1]
    if channel == "position_m" and width > 3:
        return state_label(axis)
    name = column_names(channel, width)[axis]
    short = {"position_m": "", "orientation_wxyz": "q", "joints_rad": "joint "}.get(channel, "")
    return f"{short}{name.removesuffix('_rad').rsplit('_', 1)[-1]} [{CHANNEL_UNITS[channel]}]"


def _legend(figure: Figure, has_held_out: bool, has_paths: bool) -> None:
    black = COLOUR["demonstration"]
    handles = [Line2D([], [], color=black, label="demonstration")]
    if has_held_out:
        handles.append(Line2D([], [], color=black, linestyle=":", label="held out"))
    if has_paths:
        markers = (("start", START), ("end", END))
        handles += [Line2D([], [], **marker, linestyle="", label=name) for name, marker in markers]
    figure.legend(handles=handles, loc="outside upper center", ncols=4)
