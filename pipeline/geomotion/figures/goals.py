"""Starts whose trajectories never come to the goal."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from geomotion.figures.arrays import EvaluationArrays, GoalStarts
from geomotion.figures.motion import draw_demonstrations, draw_flow, draw_goal
from geomotion.figures.style import COLOUR, label_plane, new_figure, panel_size_mm, paper_style


def draw_goal_starts(ax: Axes, goal_starts: GoalStarts) -> Axes:
    """Mark planar starts: a dot where the goal is reached, a cross where it is not."""
    reached = goal_starts.reached
    ax.plot(*goal_starts.starts[reached].T, ".", color=COLOUR["grid"], markersize=4, label="reaches the goal")
    ax.plot(*goal_starts.starts[~reached].T, "x", color=COLOUR["expanding"], markersize=5, label="never reaches it")
    draw_goal(ax, goal_starts.goal)
    ax.set_title(f"{np.count_nonzero(~reached)} of {len(reached)} starts never reach the goal")
    label_plane(ax)
    return ax


@paper_style()
def figure_goal_starts(data: EvaluationArrays) -> Figure:
    """A map of the starts that fail. `data.goal_starts` has to be present and planar."""
    assert data.goal_starts is not None
    width_mm, height_mm = panel_size_mm(data.extent, side_mm=95)
    figure = new_figure(width_mm + 15, height_mm + 20)
    ax = figure.add_subplot()
    if data.flow is not None:
        draw_flow(ax, data.flow)
    draw_demonstrations(ax, data.judged)
    draw_goal_starts(ax, data.goal_starts)
    figure.legend(loc="outside lower center", ncols=2)
    return figure
