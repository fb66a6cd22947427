"""A planned motion in one picture (Fig. 3.2, 3.3, 3.6-3.9, 4.1, 4.7)."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from geomotion.figures.joints import JOINT_MM, LIMIT, rows_of
from geomotion.figures.latent import legend_handles, maps_data
from geomotion.figures.latent_space import tube_data, tube_handles
from geomotion.figures.plan_panels import (
    ARM,
    GEODESIC,
    GOAL,
    LINE,
    START,
    VIA,
    draw_component,
    draw_directions,
    draw_joint,
    draw_plan_latent,
    draw_positions,
)
from geomotion.figures.plan_picture import PlanPicture
from geomotion.figures.style import COLOUR, new_figure, paper_style, save_figure
from geomotion.scores.configurations import ConfigurationPath
from geomotion.scores.paths import QUATERNION, MotionPath

LEGEND_MM, PANEL_MM, COMPONENT_MM = 14.0, 66.0, 42.0


@paper_style()
def figure_plan(picture: PlanPicture) -> Figure:
    """Latent space and projections above, joints or components of the orientation below."""
    is_direction = picture.arm is None and picture.orientation_dim != QUATERNION
    views = 1 + len(picture.planes) + is_direction
    columns = 2 if views in (2, 4) else 3
    rows = -(-views // columns)
    joint_rows = 0 if picture.arm is None else rows_of(len(picture.arm.joints.names))[0]
    heights = [PANEL_MM * rows, joint_rows * JOINT_MM or COMPONENT_MM]
    figure = new_figure(175, LEGEND_MM + sum(heights))
    above, below = figure.subfigures(2, 1, squeeze=False, height_ratios=heights)[:, 0]
    latent = above.add_subplot(rows, columns, 1, projection="rectilinear" if picture.maps.dim == 2 else "3d")
    draw_plan_latent(latent, picture)
    for number, plane in enumerate(picture.planes):
        draw_positions(above.add_subplot(rows, columns, 2 + number), picture, plane)
    if is_direction:
        draw_directions(above.add_subplot(rows, columns, views), picture)
    _draw_below(below, picture)
    figure.legend(handles=_handles(picture), loc="outside upper center", ncols=4)
    return figure


def _draw_below(figure: SubFigure, picture: PlanPicture) -> None:
    if picture.arm is None:
        for axis, ax in enumerate(figure.subplots(1, picture.orientation_dim, sharey=True)):
            draw_component(ax, picture, axis)
        return
    count = len(picture.arm.joints.names)
    rows, columns = rows_of(count)
    for joint in range(count):
        draw_joint(figure.add_subplot(rows, columns, 1 + joint), picture, joint)


def save_plan_figure(picture: PlanPicture, folder: Path) -> list[str]:
    """Draw a plan into `folder`; returns the names of the files."""
    return save_figure(figure_plan(picture), folder, "plan", plan_data(picture))


def plan_data(picture: PlanPicture) -> dict[str, np.ndarray]:
    """The arrays behind the picture."""
    arrays = maps_data(picture.maps) if picture.maps.dim == 2 else tube_data(picture.maps)
    if picture.closed is not None:
        arrays["closed"] = picture.closed
    for name, pieces in (("leg", picture.codes), ("line", picture.line)):
        arrays |= {f"{name}_{number}_codes": codes for number, codes in enumerate(pieces)}
    for name, paths in (("leg", picture.paths), ("line", picture.line_paths), ("demo", picture.demonstrations)):
        arrays |= path_data(name, dict(enumerate(paths)))
    for number, obstacle in enumerate(picture.obstacles):
        arrays |= {f"obstacle_{number}_{part}": getattr(obstacle, part) for part in ("vertices", "faces", "way")}
    return arrays


def path_data(name: str, paths: Mapping[int, MotionPath]) -> dict[str, np.ndarray]:
    """Arrays ``<name>_<i>_position_m``, ``<name>_<i>_orientation`` and, if there are any, ``<name>_<i>_joints_rad``."""
    arrays = {}
    for number, path in paths.items():
        arrays[f"{name}_{number}_position_m"] = path.position_m
        arrays[f"{name}_{number}_orientation"] = path.orientation
        if isinstance(path, ConfigurationPath):
            arrays[f"{name}_{number}_joints_rad"] = path.joints_rad
    return arrays


def _handles(picture: PlanPicture) -> list[Line2D | Patch]:
    handles: list[Line2D | Patch] = []
    if picture.paths:
        handles += [Line2D([], [], label="geodesic", **GEODESIC)]
    if picture.line_paths:
        handles += [Line2D([], [], label="straight latent line", **LINE)]
    handles += [Line2D([], [], color=COLOUR["demonstration"], linewidth=0.5, label="demonstration")]
    if picture.held_out:
        handles += [Line2D([], [], color=COLOUR["demonstration"], linestyle=":", linewidth=0.9, label="held out")]
    if picture.paths:
        has_via = len(picture.runs) < len(picture.paths)
        marks = {"start": START, **({"via": VIA} if has_via else {}), "goal": GOAL}
        handles += [Line2D([], [], linestyle="", label=name, **mark) for name, mark in marks.items()]
    if picture.obstacles:
        handles += [Patch(facecolor=COLOUR["obstacle"], alpha=0.5, label="obstacle")]
    if picture.shows_arm:
        handles += [Line2D([], [], color=COLOUR["riemannian"], label="arm along the path", **ARM)]
    if picture.arm is not None:
        handles += [Line2D([], [], label="joint limit", **LIMIT)]
    if picture.maps.dim == 3:
        return handles + tube_handles(picture.maps, picture.has_closed)
    if picture.has_closed:
        handles += [Patch(facecolor="none", edgecolor=COLOUR["obstacle"], hatch="/////", label="taken by obstacles")]
    return handles + legend_handles(picture.maps)
