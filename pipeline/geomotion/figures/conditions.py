"""One planar field under several conditions, Fig. 5.8."""

from collections.abc import Mapping

from matplotlib.figure import Figure

from geomotion.figures.arrays import EvaluationArrays
from geomotion.figures.motion import add_legend, draw_plane
from geomotion.figures.style import new_figure, panel_size_mm, paper_style

COLUMNS = 4
PANEL_MM, ROOM_MM, LEGEND_MM = 52, 14, 14
LEGEND_WIDTH_MM = 110
GRID_ROLLOUTS = 4  # of those that start on the grid


@paper_style()
def figure_conditions(panels: Mapping[str, EvaluationArrays]) -> Figure:
    """A panel for each condition: streamlines, its demonstrations, rollouts from their starts and from a grid, goal.

    Args:
        panels: What was evaluated under each condition, by name; planar.
    """
    columns = min(COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    sizes = [panel_size_mm(data.extent, PANEL_MM) for data in panels.values()]
    width_mm, height_mm = (max(sides) for sides in zip(*sizes, strict=True))
    total_mm = max(columns * (width_mm + ROOM_MM), LEGEND_WIDTH_MM), rows * (height_mm + ROOM_MM) + LEGEND_MM
    figure = new_figure(*total_mm)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax in axes[len(panels) :]:
        ax.set_axis_off()
    for ax, (name, data) in zip(axes, panels.items(), strict=False):
        draw_plane(ax, data, GRID_ROLLOUTS)
        ax.set_title(name)
    add_legend(figure, next(iter(panels.values())))
    return figure
