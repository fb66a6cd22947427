"""A planned motion in space, to turn and zoom: one HTML page that needs nothing else."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from geomotion.figures.plan import ObstacleShape, PlanPicture, in_a_row
from geomotion.figures.style import COLOUR
from geomotion.files import write_text
from geomotion.scores.paths import QUATERNION, PosePath

if TYPE_CHECKING:
    from plotly.graph_objects import Figure, Mesh3d, Scatter3d

Points = Float[np.ndarray, "_ 3"]
TRIADS = 12  # along each path
TRIAD_SHARE = 0.06  # of the size of the scene
AXIS_COLOURS = {"tool x": "#CC3311", "tool y": "#009E73", "tool z": "#56B4E9"}
HELD_OUT_DASH, LINE_DASH = "dot", "dash"
GREY, SPHERE = "#595959", "#E8E8E8"
MERIDIAN_DEG = 30
CONFIG = {"displaylogo": False}
HEIGHT = "92vh"
CAMERA = {"eye": {"x": 1.5, "y": 1.5, "z": 0.9}}


def save_scene(picture: PlanPicture, path: Path) -> None:
    """Write the scene as HTML: positions in space, or on the floor of one, and directions on the unit sphere.

    Args:
        picture: What was planned.
        path: Where to; whole or absent.

    Raises:
        DiskFull: If space ran out.
    """
    write_text(
        path, scene(picture).to_html(include_plotlyjs=True, default_height=HEIGHT, div_id="scene", config=CONFIG)
    )


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
        axes = {f"{axis}axis": {"title": name} for axis, name in zip("xyz", names[column], strict=True)}
        figure.update_scenes(aspectmode="data", camera=CAMERA, row=1, col=column, **axes)
    figure.update_layout(
        template="plotly_white", margin={"l": 0, "r": 0, "t": 40, "b": 0}, legend={"itemsizing": "constant"}
    )
    return figure


def triads(path: PosePath, length_m: float, count: int = TRIADS) -> dict[str, Points]:
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
                traces.append(_line(points, name, AXIS_COLOURS[name], width=3))
    return _named_once(traces)


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
        _line(points, "held out", "black", 3, HELD_OUT_DASH)
        if number in held_out
        else _line(points, "demonstration", "black", 1.5, opacity=0.6)
        for number, points in enumerate(demonstrations)
    ]
    traces += [_line(points, "straight latent line", GREY, 4, LINE_DASH) for points in lines]
    traces += [_line(points, "geodesic", COLOUR["riemannian"], 7) for points in geodesics]
    for run in in_a_row(geodesics):
        traces.append(_mark(geodesics[run[0]][0], "start", "circle", COLOUR["riemannian"]))
        traces += [_mark(geodesics[number][0], "via", "square", "white") for number in run[1:]]
        traces.append(_mark(geodesics[run[-1]][-1], "goal", "diamond", "white"))
    return traces


def _obstacle(obstacle: ObstacleShape) -> list[Any]:
    """Where it is at first; of a moving one also where it ends, translucent, and its way."""
    first = _in_space(obstacle.vertices + obstacle.way[0])
    traces = [_body(first, obstacle, obstacle.name, opacity=0.85)]
    if obstacle.moves:
        last = _in_space(obstacle.vertices + obstacle.way[-1])
        traces.append(_body(last, obstacle, f"{obstacle.name}, at the end", opacity=0.25))
        way = _in_space(obstacle.vertices.mean(axis=0) + obstacle.way)
        traces.append(_line(way, f"{obstacle.name}, way", COLOUR["obstacle"], 3, "dot"))
    return traces


def _body(vertices: Points, obstacle: ObstacleShape, name: str, opacity: float) -> "Mesh3d | Scatter3d":
    from plotly.graph_objects import Mesh3d

    if not len(obstacle.faces):
        return _line(np.concatenate([vertices, vertices[:1]]), name, COLOUR["obstacle"], 5, opacity=opacity)
    corners = dict(zip("ijk", obstacle.faces.T, strict=True))
    places = dict(zip("xyz", vertices.T, strict=True))
    return Mesh3d(
        **places, **corners, color=COLOUR["obstacle"], opacity=opacity, name=name, showlegend=True, hoverinfo="name"
    )


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
    lines = _line(grid, "sphere", "#BBBBBB", 1)
    lines.update(showlegend=False, hoverinfo="skip")
    return [body, lines]


def _line(
    points: Points, name: str, colour: str, width: float | int, dash: str = "solid", opacity: float = 1.0
) -> "Scatter3d":
    from plotly.graph_objects import Scatter3d

    look = {"color": colour, "width": width, "dash": dash}
    return Scatter3d(
        **dict(zip("xyz", points.T, strict=True)), mode="lines", line=look, opacity=opacity, name=name, legendgroup=name
    )


def _mark(point: Float[np.ndarray, " 3"], name: str, symbol: str, colour: str) -> "Scatter3d":
    from plotly.graph_objects import Scatter3d

    look = {"symbol": symbol, "color": colour, "size": 7, "line": {"color": "black", "width": 2}}
    x, y, z = point
    return Scatter3d(x=[x], y=[y], z=[z], mode="markers", marker=look, name=name, legendgroup=name)


def _named_once(traces: list[Any]) -> list[Any]:
    """One entry in the legend for each name."""
    seen: set[str] = set()
    for trace in traces:
        trace.showlegend = trace.name not in seen
        seen.add(trace.name)
    return traces


def _in_space(points: Float[np.ndarray, "_ _"]) -> Points:
    """Planar points at height zero."""
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
