"""Rollouts of a planar field beside the demonstrations, with the obstacles in their way."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from geomotion.figures.arrays import Array, Flow
from geomotion.figures.motion import draw_flow
from geomotion.figures.style import COLOUR, label_plane, limit_to, new_figure, panel_size_mm, paper_style

LEGEND_MM = 110


@dataclass(frozen=True)
class PlanarRollouts:
    """What is drawn, all in metres.

    Attributes:
        demonstrations: Demonstrated paths, shape (T, 2) each.
        rollouts: Computed paths, shape (T, 2) each.
        outlines: Borders of the obstacles at the start, shape (n, 2) each.
        final_outlines: The same at the end; equal to `outlines` for obstacles at rest.
        goals: Where motions end, one or more for fields with conditions, shape (n, 2).
        corner_rollouts: Computed paths from elsewhere, shape (T, 2) each.
        flow: Velocities on a grid, where they are the same for all rollouts.
    """

    demonstrations: Sequence[Array]
    rollouts: Sequence[Array]
    outlines: Sequence[Array]
    final_outlines: Sequence[Array]
    goals: Array
    corner_rollouts: Sequence[Array] = ()
    flow: Flow | None = None

    def arrays(self) -> dict[str, Array]:
        """The same by name.

        ``demo_<i>``, ``rollout_<i>``, ``corner_rollout_<i>``, ``obstacle_<i>``, ``obstacle_at_end_<i>``, ``goals``,
        ``field_points``, ``field_velocity``.
        """
        groups = {
            "demo": self.demonstrations,
            "rollout": self.rollouts,
            "corner_rollout": self.corner_rollouts,
            "obstacle": self.outlines,
            "obstacle_at_end": self.final_outlines,
        }
        named = {f"{name}_{number}": one for name, many in groups.items() for number, one in enumerate(many)}
        flow = {} if self.flow is None else {"field_points": self.flow.points, "field_velocity": self.flow.velocity}
        return named | {"goals": self.goals} | flow


def draw_obstacles(ax: Axes, outlines: Sequence[Array], final_outlines: Sequence[Array]) -> Axes:
    """Draw obstacles filled, and dashed where those that move end."""
    for outline, final in zip(outlines, final_outlines, strict=True):
        ax.fill(*outline.T, color=COLOUR["obstacle"], alpha=0.45, linewidth=0, zorder=1)
        if not np.array_equal(outline, final):
            ax.plot(*final.T, color=COLOUR["obstacle"], linestyle="--", linewidth=0.8, zorder=1)
    return ax


@paper_style()
def figure_rollouts(data: PlanarRollouts) -> Figure:
    """Demonstrations in black, rollouts with their starts in orange, obstacles in red."""
    shown = np.concatenate([*data.demonstrations, *data.outlines, *data.final_outlines, data.goals])
    starts = np.array([path[0] for path in data.rollouts]).reshape(-1, 2)
    corners = np.array([path[0] for path in data.corner_rollouts]).reshape(-1, 2)
    shown = np.concatenate([shown, starts, corners])
    width_mm, height_mm = panel_size_mm(shown, side_mm=95)
    figure = new_figure(max(width_mm + 15, LEGEND_MM), height_mm + 20)
    ax = figure.add_subplot()
    if data.flow is not None:
        draw_flow(ax, data.flow)
    draw_obstacles(ax, data.outlines, data.final_outlines)
    for path in data.demonstrations:
        ax.plot(*path.T, color=COLOUR["demonstration"], linewidth=1.0, zorder=2)
    for path in data.rollouts:
        ax.plot(*path.T, color=COLOUR["rollout"], zorder=3)
    ax.plot(*starts.T, "o", color=COLOUR["rollout"], mec="black", mew=0.5, markersize=4, zorder=4)
    for path in data.corner_rollouts:
        ax.plot(*path.T, color=COLOUR["grid"], zorder=3)
    ax.plot(*corners.T, "o", color=COLOUR["grid"], mec="black", mew=0.5, markersize=4, zorder=4)
    ax.plot(*data.goals.T, marker="*", color="white", mec="black", markersize=9, linestyle="", zorder=4)
    limit_to(ax, shown)
    label_plane(ax)
    handles = [
        Line2D([], [], color=COLOUR["demonstration"], label="demonstration"),
        Line2D([], [], color=COLOUR["rollout"], label="rollout"),
        Line2D([], [], marker="*", color="white", mec="black", markersize=9, linestyle="", label="goal"),
    ]
    if data.corner_rollouts:
        handles.insert(2, Line2D([], [], color=COLOUR["grid"], label="rollout from a corner"))
    if data.outlines:
        handles.append(Patch(color=COLOUR["obstacle"], alpha=0.45, linewidth=0, label="obstacle"))  # type: ignore[arg-type]
    figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure
