"""A planned motion in space, to turn and zoom: one HTML page that needs nothing else."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from geomotion.figures.latent import group_colour
from geomotion.figures.plan_picture import ObstacleShape, PlanPicture
from geomotion.figures.style import COLOUR
from geomotion.figures.traces3d import Points, arrange, legs, line, named_once, polylines, save_page, surface
from geomotion.scores.paths import QUATERNION, MotionPath

if TYPE_CHECKING:
    from plotly.graph_objects import Figure, Mesh3d, Scatter3d

TRIADS = 12  # along each path
TRIAD_SHARE = 0.06  # of the size of the scene
AXIS_COLOURS = {"tool x": "#CC3311", "tool y": "#009E73", "tool z": "#56B4E9"}
HELD_OUT_DASH, SPHERE = "dot", "#E8E8E8"
MERIDIAN_DEG = 30


def save_scene(picture: PlanPicture, path: Path) -> None:
    """Write the scene as HTML: positions in space, or on the floor of one, and directions on the unit sphere.

    Args:
        picture: What was planned.
        path: Where to; whole or absent.

    Raises:
        DiskFull: If space ran out.
    """
    save_page(scene(picture), path)


def scene(picture: PlanPicture) -> "Figure":
    """The scene; directions, where orientations are no quaternions, in a second one beside it."""
    from plotly.subplots import make_subplots

    has_sphere = picture.orientation_dim != QUATERNION
    titles = ["tool positions", "tool directions on the unit sphere"][: 1 + has_sphere]
    figure = make_subplots(1, len(titles), specs=[[{"type": "scene"}] * len(titles)], subplot_titles=titles)
    figure.add_traces(_position_traces(picture), rows=1, cols=1)
    if has_sphere:
        figure.add_traces(_direction_traces(picture), rows=1, cols=2)
    names = {1: ("x [m]", "y [m]", "z [m]"), 2: ("direction x [1]", "direction y [1]", "direction z [1]")}
    for column in range(1, 1 + len(titles)):
        arrange(figure, names[column], column)
    return figure


def triads(path: MotionPath, length_m: float, count: int = TRIADS) -> dict[str, Points]:
    """Axes of the tool at some poses along a path, each as one polyline with gaps [m].

    Args:
        path: Poses with quaternions.
        length_m: Length of each axis [m].
        count: How many poses, ends included.
    """
    chosen = np.unique(np.linspace(0, len(path) - 1, count).round().astype(int))
    origin = path.position_m[chosen]
    turns = Rotation.from_quat(path.orientation[chosen], scalar_first=True).as_matrix()
    gap = np.full_like(origin, np.nan)
    return {
        name: np.stack([origin, origin + length_m * turns[..., axis], gap], axis=1).reshape(-1, 3)
        for axis, name in enumerate(AXIS_COLOURS)
    }


def _position_traces(picture: PlanPicture) -> list[Any]:
    demonstrations = [_in_space(path.position_m) for path in picture.demonstrations]
    geodesics = [_in_space(path.position_m) for path in picture.paths]
    lines = [_in_space(path.position_m) for path in picture.line_paths]
    traces = [trace for obstacle in picture.obstacles for trace in _obstacle(obstacle)]
    traces += _curves(demonstrations, geodesics, lines, picture.held_out)
    if picture.orientation_dim == QUATERNION:
        size_m = float(np.linalg.norm(np.ptp(np.concatenate(demonstrations), axis=0)))
        for path in picture.paths:
            for name, points in triads(path, TRIAD_SHARE * size_m).items():
                traces.append(line(points, name, AXIS_COLOURS[name], width=3))
    return named_once(traces + _arm_traces(picture))


def _arm_traces(picture: PlanPicture) -> list["Scatter3d"]:
    """Links of the arm as polylines, along the path and, at first hidden, along one demonstration of each group."""
    if picture.arm is None:
        return []
    along = [_in_space(pose) for poses in picture.arm.along for pose in poses]
    traces = [polylines(along, "arm along the path", COLOUR["riemannian"], 4, opacity=0.5)] if along else []
    for group, poses in picture.arm.demonstrated.items():
        colour = group_colour(group, picture.groups)
        shown = polylines(map(_in_space, poses), f"arm, demonstrated in group {group}", colour, 3, opacity=0.5)
        shown.visible = "legendonly"
        traces.append(shown)
    return traces


def _direction_traces(picture: PlanPicture) -> list[Any]:
    pieces = (picture.demonstrations, picture.paths, picture.line_paths)
    demonstrations, geodesics, lines = ([path.orientation for path in piece] for piece in pieces)
    curves = _curves(demonstrations, geodesics, lines, picture.held_out)
    for trace in curves:
        trace.showlegend = False
    return [*_sphere(), *curves]


def _curves(
    demonstrations: Sequence[Points], geodesics: Sequence[Points], lines: Sequence[Points], held_out: Sequence[int]
) -> list["Scatter3d"]:
    traces = [
        line(points, "held out", "black", 3, HELD_OUT_DASH)
        if number in held_out
        else line(points, "demonstration", "black", 1.5, opacity=0.6)
        for number, points in enumerate(demonstrations)
    ]
    return traces + legs(geodesics, lines)


def _obstacle(obstacle: ObstacleShape) -> list[Any]:
    """Where it is at first; of a moving one also where it ends, translucent, and its way."""
    first = _in_space(obstacle.vertices + obstacle.way[0])
    traces = [_body(first, obstacle, obstacle.name, opacity=0.85)]
    if obstacle.moves:
        last = _in_space(obstacle.vertices + obstacle.way[-1])
        traces.append(_body(last, obstacle, f"{obstacle.name}, at the end", opacity=0.25))
        way = _in_space(obstacle.vertices.mean(axis=0) + obstacle.way)
        traces.append(line(way, f"{obstacle.name}, way", COLOUR["obstacle"], 3, "dot"))
    return traces


def _body(vertices: Points, obstacle: ObstacleShape, name: str, opacity: float) -> "Mesh3d | Scatter3d":
    if not len(obstacle.faces):
        return line(np.concatenate([vertices, vertices[:1]]), name, COLOUR["obstacle"], 5, opacity=opacity)
    return surface(vertices, obstacle.faces, name, COLOUR["obstacle"], opacity)


def _sphere() -> list[Any]:
    """The unit sphere with meridians and parallels."""
    from plotly.graph_objects import Surface

    around, across = np.linspace(0, 2 * np.pi, 73), np.linspace(0, np.pi, 37)
    surface = np.stack(
        [
            np.outer(np.cos(around), np.sin(across)),
            np.outer(np.sin(around), np.sin(across)),
            np.outer(np.ones_like(around), np.cos(across)),
        ]
    )
    step = round(MERIDIAN_DEG / 5)
    gap = np.full((1, 3), np.nan)
    net = [surface[:, row] for row in range(0, 73, step)] + [surface[:, :, column] for column in range(0, 37, step)]
    grid = np.concatenate([part for curve in net for part in (1.002 * curve.T, gap)])
    look: dict[str, Any] = {"showscale": False, "opacity": 0.6, "hoverinfo": "skip"}
    body = Surface(**dict(zip("xyz", surface, strict=True)), colorscale=[[0, SPHERE], [1, SPHERE]], **look)
    lines = line(grid, "sphere", "#BBBBBB", 1)
    lines.update(showlegend=False, hoverinfo="skip")
    return [body, lines]


def _in_space(points: Float[np.ndarray, "_ _"]) -> Points:
    """Planar points at height zero."""
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
