"""The learned motion: vector field, demonstrations and rollouts in a plane, or coordinates over time."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from geomotion.figures.arrays import Array, EvaluationArrays, Flow, Judged
from geomotion.figures.style import COLOUR, label_plane, new_figure, panel_size_mm, paper_style, state_label

LEGEND_MM = 110  # what the legend needs
GRID_ROLLOUTS = 8  # of those that start on the grid: enough to see where they go, few enough to see the field
COLUMNS = 2
DIVERGENCE_MARGIN = 0.3  # of the range of the demonstrations
DASHES = (0, (3, 1.5))  # held-out rollouts


def draw_flow(ax: Axes, flow: Flow) -> Axes:
    """Draw the vector field as streamlines."""
    x, y = (np.unique(flow.points[:, axis]) for axis in (0, 1))
    order = np.lexsort((flow.points[:, 0], flow.points[:, 1]))
    u, v = (flow.velocity[order, axis].reshape(len(y), len(x)) for axis in (0, 1))
    # streamplot insists on equal spacing to the last digit
    x, y = np.linspace(x[0], x[-1], len(x)), np.linspace(y[0], y[-1], len(y))
    ax.streamplot(x, y, u, v, color=COLOUR["field"], linewidth=0.6, density=1.1, arrowsize=0.6, zorder=0)
    return ax


def draw_demonstrations(ax: Axes, judged: Sequence[Judged]) -> Axes:
    """Draw planar demonstrations in black, the held-out ones dotted."""
    for item in judged:
        style = ":" if item.held_out else "-"
        ax.plot(*item.demonstration.T, color=COLOUR["demonstration"], linestyle=style, linewidth=1.0, zorder=2)
    return ax


def draw_rollouts(ax: Axes, judged: Sequence[Judged]) -> Axes:
    """Draw planar rollouts from the demonstrations' starts in orange, the held-out ones dashed, with their starts."""
    for item in judged:
        style = DASHES if item.held_out else "-"
        ax.plot(*item.rollout.T, color=COLOUR["rollout"], linestyle=style, linewidth=1.4, zorder=3)
    starts = np.array([item.rollout[0] for item in judged])
    ax.plot(*starts.T, "o", color=COLOUR["rollout"], mec="black", mew=0.5, markersize=4, zorder=4)
    return ax


def draw_grid_rollouts(ax: Axes, rollouts: Array) -> Axes:
    """Draw planar rollouts of shape (rollout, time, 2) in green, with their starts."""
    ax.plot(rollouts[..., 0].T, rollouts[..., 1].T, color=COLOUR["grid"], linewidth=0.9, zorder=1)
    ax.plot(*rollouts[:, 0].T, "s", color=COLOUR["grid"], markersize=3, clip_on=False, zorder=1)
    return ax


def draw_goal(ax: Axes, goal: Array) -> Axes:
    """Mark the goal with a star."""
    ax.plot(*goal, "*", color="white", markeredgecolor="black", markeredgewidth=0.8, markersize=10, zorder=5)
    return ax


def draw_coordinate(ax: Axes, judged: Sequence[Judged], axis: int, name: str | None = None) -> Axes:
    """Draw one coordinate of demonstrations and rollouts over time."""
    for item in judged:
        demonstrated, rolled = (":", DASHES) if item.held_out else ("-", "-")
        states = item.demonstration[:, axis], item.rollout[:, axis]
        ax.plot(item.time_s, states[0], color=COLOUR["demonstration"], linestyle=demonstrated, linewidth=0.9)
        ax.plot(item.time_s, states[1], color=COLOUR["rollout"], linestyle=rolled, linewidth=1.2)
    # a rollout that diverges may leave the axes, but not shrink everything else
    values = np.concatenate([item.demonstration[:, axis] for item in judged])
    margin = DIVERGENCE_MARGIN * (float(np.ptp(values)) or 1.0)
    ax.set(ylabel=name or state_label(axis), ylim=(values.min() - margin, values.max() + margin))
    ax.margins(x=0.01)
    return ax


@paper_style()
def figure_motion(data: EvaluationArrays) -> Figure:
    """What was learned: a plane with the field for D = 2, coordinates over time otherwise."""
    return _figure_plane(data) if data.dim == 2 else _figure_coordinates(data)


def draw_plane(ax: Axes, data: EvaluationArrays, grid_rollouts: int) -> Axes:
    """Draw a planar field with all demonstrations and rollouts, and as many of the rollouts from the grid."""
    if data.flow is not None:
        draw_flow(ax, data.flow)
        ax.set(xlim=_limits(data.flow.points[:, 0]), ylim=_limits(data.flow.points[:, 1]))
    if data.region is not None:
        rollouts = data.region.rollouts
        draw_grid_rollouts(ax, rollouts[widely_spread(rollouts[:, 0], grid_rollouts)])
    draw_demonstrations(ax, data.judged)
    draw_rollouts(ax, data.judged)
    if data.goal_starts is not None:
        draw_goal(ax, data.goal_starts.goal)
    label_plane(ax)
    return ax


def widely_spread(points: Array, count: int) -> list[int]:
    """Numbers of `count` points far from each other: each next one is farthest from those taken before.

    Args:
        points: Shape (n, D) [m].
        count: How many, at most n.
    """
    chosen = [int(np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1)))]
    distance = np.linalg.norm(points - points[chosen[0]], axis=1)
    while len(chosen) < min(count, len(points)):
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return chosen


def _figure_plane(data: EvaluationArrays) -> Figure:
    width_mm, height_mm = panel_size_mm(data.extent, side_mm=95)
    figure = new_figure(max(width_mm + 15, LEGEND_MM), height_mm + 20)
    draw_plane(figure.add_subplot(), data, GRID_ROLLOUTS)
    add_legend(figure, data)
    return figure


def _figure_coordinates(data: EvaluationArrays) -> Figure:
    rows = -(-data.dim // COLUMNS)
    figure = new_figure(width_mm=150, height_mm=20 + 30 * rows)
    grid = figure.subplots(rows, COLUMNS, sharex=True, squeeze=False)
    for axis, ax in enumerate(grid.flat):
        if axis < data.dim:
            draw_coordinate(ax, data.judged, axis, data.names[axis] if data.names else None)
        else:
            ax.set_axis_off()
    for ax in grid[-1]:
        ax.set_xlabel("time [s]")
    add_legend(figure, data)
    return figure


def _limits(values: Array) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def add_legend(figure: Figure, data: EvaluationArrays) -> None:
    """Say above the panels what lines and marks are."""

    def line(label: str, colour: str, style: Any = "-") -> Line2D:
        return Line2D([], [], color=COLOUR[colour], linestyle=style, label=label)

    handles = [line("demonstration", "demonstration"), line("rollout from its start", "rollout")]
    if data.has_held_out:
        handles.append(line("held-out demonstration", "demonstration", ":"))
        handles.append(line("held-out rollout", "rollout", DASHES))
    if data.dim == 2 and data.region is not None:
        handles.append(line("rollout from a grid", "grid"))
    if data.dim == 2 and data.goal_starts is not None:
        handles.append(Line2D([], [], marker="*", color="white", mec="black", markersize=9, linestyle="", label="goal"))
    figure.legend(handles=handles, loc="outside upper center", ncols=3)
