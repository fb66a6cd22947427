"""Pictures of recordings: paths in a plane, projections of paths in space, directions on the sphere, all over time."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from geomotion.demos.columns import column_names
from geomotion.demos.demonstrations import CHANNEL_UNITS, VELOCITY_OF, Demonstrations, Trajectory
from geomotion.figures.style import COLOUR, SEQUENCE, new_figure, paper_style, state_label

COLUMNS = 4
LEGEND_MM, PATHS_MM, ROW_MM = 12.0, 58.0, 34.0
PROJECTIONS = ((0, 1), (0, 2), (1, 2))
PARALLELS_DEG, MERIDIANS_DEG = (30, 60, 90), (0, 45, 90, 135)
GROUP_COLOURS = tuple(SEQUENCE[number] for number in (0, 1, 4, 5, 2, 3))  # most different ones first
START: dict[str, Any] = {"marker": "o", "color": COLOUR["rollout"], "mec": "black", "mew": 0.5, "markersize": 4}
END: dict[str, Any] = {"marker": "*", "color": "white", "mec": "black", "mew": 0.7, "markersize": 9}


def group_colours(demonstrations: Demonstrations) -> dict[str, str]:
    """A colour for every label, where labels name groups; empty where they do not, or where there are too many."""
    labels = [trajectory.label for trajectory in demonstrations.trajectories]
    groups = list(dict.fromkeys(labels))
    are_groups = 1 < len(groups) < len(labels) and len(groups) <= len(GROUP_COLOURS)
    return dict(zip(groups, GROUP_COLOURS, strict=False)) if are_groups else {}


def draw_paths(
    ax: Axes, demonstrations: Demonstrations, plane: tuple[int, int] = (0, 1), held_out: Collection[int] = ()
) -> Axes:
    """Draw positions projected to a plane: start as circle, end as star, held-out demonstrations dotted."""
    _draw_curves(ax, demonstrations, "position_m", plane, held_out)
    ax.set_aspect("equal", adjustable="datalim")
    for direction in (ax.xaxis, ax.yaxis):
        direction.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 5, 10]))
    return ax


def draw_directions(ax: Axes, demonstrations: Demonstrations, held_out: Collection[int] = ()) -> Axes:
    """Draw directions on the unit sphere, seen from its pole (the z axis) and from far away."""
    thin: dict[str, Any] = {"color": COLOUR["field"], "linewidth": 0.4, "zorder": 1}
    around = np.linspace(0, 2 * np.pi, 200)
    for colatitude in np.radians(PARALLELS_DEG):
        ax.plot(np.sin(colatitude) * np.cos(around), np.sin(colatitude) * np.sin(around), **thin)
    for longitude in np.radians(MERIDIANS_DEG):
        ends = np.array([-1.0, 1.0])
        ax.plot(np.cos(longitude) * ends, np.sin(longitude) * ends, **thin)
    _draw_curves(ax, demonstrations, "direction_xyz", (0, 1), held_out)
    ax.set(aspect="equal", xticks=(-1, 0, 1), yticks=(-1, 0, 1))
    return ax


def draw_axis(
    ax: Axes, demonstrations: Demonstrations, channel: str, axis: int, held_out: Collection[int] = ()
) -> Axes:
    """Draw one axis of a channel over time, held-out demonstrations dotted."""
    for trajectory, colour, style in _looks(demonstrations, held_out):
        values = trajectory.channels[channel][:, axis]
        ax.plot(trajectory.time_s, values, color=colour, linestyle=style, linewidth=0.7)
    ax.set(ylabel=_axis_label(channel, axis, demonstrations))
    ax.margins(x=0.01)
    return ax


@paper_style()
def figure_demonstrations(
    demonstrations: Demonstrations, channels: Sequence[str] | None = None, held_out: Collection[int] = ()
) -> Figure:
    """Paths for planar positions; otherwise every axis over time, below projections of positions and directions.

    Demonstrations whose labels name groups are drawn in one colour a group.

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
    has_paths = widths.get("position_m") in (2, 3) or "direction_xyz" in widths
    _legend(figure, group_colours(demonstrations), has_held_out, has_paths)
    return figure


def figure_data(demonstrations: Demonstrations) -> dict[str, NDArray[np.float64]]:
    """The arrays behind the picture: ``demo_<i>_<channel>`` and ``demo_<i>_time_s``."""
    arrays: dict[str, NDArray[np.float64]] = {}
    for number, trajectory in enumerate(demonstrations.trajectories):
        arrays[f"demo_{number}_time_s"] = trajectory.time_s
        arrays |= {f"demo_{number}_{name}": values for name, values in trajectory.channels.items()}
    return arrays


def _looks(demonstrations: Demonstrations, held_out: Collection[int]) -> Iterator[tuple[Trajectory, str, str]]:
    """Every demonstration with its colour and line style."""
    colours = group_colours(demonstrations)
    for number, trajectory in enumerate(demonstrations.trajectories):
        yield trajectory, colours.get(trajectory.label, COLOUR["demonstration"]), ":" if number in held_out else "-"


def _draw_curves(
    ax: Axes, demonstrations: Demonstrations, channel: str, plane: tuple[int, int], held_out: Collection[int]
) -> None:
    """Curves of two axes of a channel with their ends."""
    has_groups = bool(group_colours(demonstrations))
    for trajectory, colour, style in _looks(demonstrations, held_out):
        path = trajectory.channels[channel][:, plane]
        start = START | {"color": colour} if has_groups else START
        ax.plot(*path.T, color=colour, linestyle=style, linewidth=0.9, zorder=2)
        ax.plot(*path[0], **start, zorder=3)
        ax.plot(*path[-1], **END, zorder=4)
    names = [_axis_label(channel, axis, demonstrations) for axis in plane]
    ax.set(xlabel=names[0], ylabel=names[1])


def _small_multiples(demonstrations: Demonstrations, widths: Mapping[str, int], held_out: Collection[int]) -> Figure:
    """Every axis over time, channels in rows of their own; above them paths in the plane, in space, on the sphere."""
    planes = {2: PROJECTIONS[:1], 3: PROJECTIONS}.get(widths.get("position_m", 0), ())
    views = len(planes) + ("direction_xyz" in widths)
    cells = _cells(widths)
    heights = [PATHS_MM] * bool(views) + [ROW_MM * len(cells)]
    figure = new_figure(width_mm=175, height_mm=LEGEND_MM + sum(heights))
    *above, below = figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
    for part in above:
        axes = part.subplots(1, views, squeeze=False)[0]
        for ax, plane in zip(axes, planes, strict=False):
            draw_paths(ax, demonstrations, plane, held_out)
        if "direction_xyz" in widths:
            draw_directions(axes[-1], demonstrations, held_out)
    grid = below.subplots(*cells.shape, squeeze=False)
    for (row, column), cell in np.ndenumerate(cells):
        ax = grid[row, column]
        if cell is None:
            ax.set_axis_off()
            continue
        channel, axis = cell
        draw_axis(ax, demonstrations, channel, axis, held_out)
        if row + 1 == len(cells) or cells[row + 1, column] is None:
            ax.set_xlabel("time [s]")
    return figure


def _cells(widths: Mapping[str, int]) -> NDArray[np.object_]:
    """Channel and axis of every panel over time, None where there is none, shape (row, column)."""
    columns = min(COLUMNS, max(widths.values()))
    rows: list[list[tuple[str, int] | None]] = []
    for channel, width in widths.items():
        for first in range(0, width, columns):
            axes = range(first, min(first + columns, width))
            rows.append([*((channel, axis) for axis in axes), *[None] * (columns - len(axes))])
    cells = np.empty((len(rows), columns), dtype=object)
    for row, panels in enumerate(rows):
        for column, panel in enumerate(panels):
            cells[row, column] = panel
    return cells


def _axis_label(channel: str, axis: int, demonstrations: Demonstrations) -> str:
    width = demonstrations[0].channels[channel].shape[1]
    if channel == "position_m" and width > 3:
        return state_label(axis)
    if channel == "joints_rad" and demonstrations.joint_names:
        return f"{demonstrations.joint_names[axis].removesuffix('_joint')} [rad]"
    name = column_names(channel, width)[axis]
    short = {"position_m": "", "orientation_wxyz": "q", "joints_rad": "joint ", "direction_xyz": "direction "}.get(
        channel, ""
    )
    return f"{short}{name.removesuffix('_rad').rsplit('_', 1)[-1]} [{CHANNEL_UNITS[channel]}]"


def _legend(figure: Figure, groups: Mapping[str, str], has_held_out: bool, has_paths: bool) -> None:
    black = COLOUR["demonstration"]
    lines = groups or {"demonstration": black}
    handles = [Line2D([], [], color=colour, label=name) for name, colour in lines.items()]
    if has_held_out:
        handles.append(Line2D([], [], color=black, linestyle=":", label="held out"))
    if has_paths:
        start = START | {"color": "white"} if groups else START
        handles += [Line2D([], [], **look, linestyle="", label=name) for name, look in (("start", start), ("end", END))]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles))
