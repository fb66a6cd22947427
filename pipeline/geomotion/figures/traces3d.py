"""Lines, marks and surfaces of interactive pictures, and pages that need nothing else."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, Integer

from geomotion.figures.plan_picture import in_a_row
from geomotion.figures.style import COLOUR
from geomotion.files import write_text

if TYPE_CHECKING:
    from plotly.graph_objects import Figure, Mesh3d, Scatter3d

Points = Float[np.ndarray, "_ 3"]
CAMERA = {"eye": {"x": 1.5, "y": 1.5, "z": 0.9}}
GREY, LINE_DASH = "#595959", "dash"
CONFIG = {"displaylogo": False}
HEIGHT = "92vh"


def save_page(figure: "Figure", path: Path) -> None:
    """Write a figure as HTML that loads nothing.

    Raises:
        DiskFull: If space ran out.
    """
    write_text(path, figure.to_html(include_plotlyjs=True, default_height=HEIGHT, div_id="scene", config=CONFIG))


def arrange(figure: "Figure", axis_titles: tuple[str, str, str], column: int = 1) -> None:
    """Equal scales, titles of the axes, and where the eye is, for the scene in a column."""
    axes = {f"{axis}axis": {"title": title} for axis, title in zip("xyz", axis_titles, strict=True)}
    figure.update_scenes(aspectmode="data", camera=CAMERA, row=1, col=column, **axes)
    figure.update_layout(
        template="plotly_white", margin={"l": 0, "r": 0, "t": 40, "b": 0}, legend={"itemsizing": "constant"}
    )


def line(
    points: Points, name: str, colour: str, width: float | int, dash: str = "solid", opacity: float = 1.0
) -> "Scatter3d":
    """A polyline."""
    from plotly.graph_objects import Scatter3d

    look = {"color": colour, "width": width, "dash": dash}
    return Scatter3d(
        **dict(zip("xyz", points.T, strict=True)), mode="lines", line=look, opacity=opacity, name=name, legendgroup=name
    )


def polylines(
    pieces: Iterable[Points], name: str, colour: str, width: float | int, opacity: float = 1.0
) -> "Scatter3d":
    """Several polylines as one, with gaps."""
    gap = np.full((1, 3), np.nan)
    return line(
        np.concatenate([part for piece in pieces for part in (piece, gap)]), name, colour, width, "solid", opacity
    )


def mark(point: Float[np.ndarray, " 3"], name: str, symbol: str, colour: str) -> "Scatter3d":
    """A marker with a black rim."""
    from plotly.graph_objects import Scatter3d

    look = {"symbol": symbol, "color": colour, "size": 7, "line": {"color": "black", "width": 2}}
    x, y, z = point
    return Scatter3d(x=[x], y=[y], z=[z], mode="markers", marker=look, name=name, legendgroup=name)


def legs(geodesics: Sequence[Points], lines: Sequence[Points]) -> list["Scatter3d"]:
    """Geodesics over straight latent lines; where each row of them starts, passes and ends."""
    traces = [line(points, "straight latent line", GREY, 4, LINE_DASH) for points in lines]
    traces += [line(points, "geodesic", COLOUR["riemannian"], 7) for points in geodesics]
    for run in in_a_row(geodesics):
        traces.append(mark(geodesics[run[0]][0], "start", "circle", COLOUR["riemannian"]))
        traces += [mark(geodesics[number][0], "via", "square", "white") for number in run[1:]]
        traces.append(mark(geodesics[run[-1]][-1], "goal", "diamond", "white"))
    return traces


def surface(vertices: Points, faces: Integer[np.ndarray, "face 3"], name: str, colour: str, opacity: float) -> "Mesh3d":
    """Triangles in one colour."""
    from plotly.graph_objects import Mesh3d

    corners, places = dict(zip("ijk", faces.T, strict=True)), dict(zip("xyz", vertices.T, strict=True))
    return Mesh3d(**places, **corners, color=colour, opacity=opacity, name=name, showlegend=True, hoverinfo="name")


def named_once(traces: list[Any]) -> list[Any]:
    """One entry in the legend for each name."""
    seen: set[str] = set()
    for trace in traces:
        trace.showlegend = trace.name not in seen
        seen.add(trace.name)
    return traces
