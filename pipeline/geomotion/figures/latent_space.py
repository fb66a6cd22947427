"""A latent space of three dimensions: tubes of the magnification factor around encoded demonstrations (Fig. 4.7)."""

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from geomotion.figures.isosurface import Mesh
from geomotion.figures.latent import LatentMaps, group_colour, group_names, maps_data
from geomotion.figures.style import COLOUR, new_figure, paper_style, save_figure
from geomotion.figures.tubes import Tubes, obstructed, tubes_of, wall_level

VIEWS = ((25.0, -60.0), (25.0, 30.0))  # elevation and azimuth of the eye [deg]
WALL_GREYS, OBSTACLE_SHADES = (0.74, 0.95), (0.7, 1.0)  # of faces seen edge on and straight on
CODES: dict[str, Any] = {"linewidth": 0.8, "alpha": 0.9, "zorder": 2}
ZOOM = 0.95  # leaves room for labels, of which layouts know nothing in three dimensions
LEAST_ASPECT = 0.3  # of the longest axis
PANEL_MM = 84.0


@paper_style()
def draw_latent_space(
    ax: Axes3D,
    maps: LatentMaps,
    tubes: Tubes,
    view: tuple[float, float] = VIEWS[0],
    closed: Bool[np.ndarray, "nx ny nz"] | None = None,
) -> Axes3D:
    """Draw tubes cut open towards the eye, the demonstrations in them, and what obstacles take of them in red.

    Only the walls behind the insides are drawn: those before them would hide what is in the tubes.

    Args:
        ax: Where to draw, in three dimensions.
        maps: The latent space.
        tubes: Its tubes.
        view: Elevation and azimuth of the eye [deg].
        closed: Nodes that obstacles take.
    """
    away, scales = -_to_eye(view), _scales(maps)
    pieces = [_seen(tubes.wall, scales, away, np.ones(3), WALL_GREYS)]
    if closed is not None:
        colour = np.array(to_rgb(COLOUR["obstacle"]))
        pieces.append(_seen(obstructed(maps, tubes, closed), scales, away, colour, OBSTACLE_SHADES))
    corners, colours = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
    surface = Poly3DCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.2, zorder=1)
    surface.set_rasterized(True)
    ax.computed_zorder = False
    ax.add_collection3d(surface)
    for codes, group in zip(maps.codes, maps.groups, strict=True):
        ax.plot(*codes.T, color=group_colour(group, maps.groups), **CODES)
    _frame(ax, maps, view)
    return ax


def tube_handles(maps: LatentMaps, has_closed: bool = False) -> list[Line2D | Patch]:
    """What lines and surfaces mean."""
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=group_colour(group, maps.groups), label=name, **CODES)
        for group, name in group_names(maps.groups).items()
    ]
    wall = rf"walls: $\log\,\sqrt{{\det M}} = {wall_level(maps):.1f}$"
    handles.append(Patch(facecolor="0.9", edgecolor="0.6", linewidth=0.5, label=wall))
    if has_closed:
        handles.append(Patch(facecolor=COLOUR["obstacle"], label="taken by obstacles"))
    return handles


@paper_style()
def figure_latent_space(maps: LatentMaps) -> Figure:
    """The same tubes from two sides."""
    figure = new_figure(2 * PANEL_MM + 7, PANEL_MM)
    tubes = tubes_of(maps)
    for number, view in enumerate(VIEWS):
        draw_latent_space(figure.add_subplot(1, 2, 1 + number, projection="3d"), maps, tubes, view)
    figure.legend(handles=tube_handles(maps), loc="outside upper center", ncols=4)
    return figure


def save_latent_space_figure(maps: LatentMaps, folder: Path) -> list[str]:
    """Draw the latent space into `folder`; returns the names of the files."""
    return save_figure(figure_latent_space(maps), folder, "latent", tube_data(maps))


def tube_data(maps: LatentMaps) -> dict[str, np.ndarray]:
    """The arrays behind the picture."""
    return maps_data(maps) | {"level": np.array(wall_level(maps))}


def _seen(
    mesh: Mesh,
    scales: Float[np.ndarray, " 3"],
    towards: Float[np.ndarray, " 3"],
    colour: Float[np.ndarray, " 3"],
    shades: tuple[float, float],
) -> tuple[Float[np.ndarray, "face 3 3"], Float[np.ndarray, "face 3"]]:
    """Corners and colours of the faces whose normals, as drawn, point to one side; paler the straighter they do."""
    normals = mesh.normals / scales
    length = np.linalg.norm(normals, axis=1)
    straight = normals @ towards / np.where(length > 0, length, 1.0)
    is_seen = straight > 0
    shade = np.interp(straight[is_seen], (0, 1), shades)
    return mesh.vertices[mesh.faces[is_seen]], shade[:, None] * colour


def _to_eye(view: tuple[float, float]) -> Float[np.ndarray, " 3"]:
    elevation, azimuth = np.radians(view)
    across = np.cos(elevation)
    return np.array([across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation)])


def _scales(maps: LatentMaps) -> Float[np.ndarray, " 3"]:
    """How long a unit of each axis is drawn; as long as the others, unless its labels would then lie on each other."""
    extent = np.diff(maps.corners, axis=0)[0]
    return np.asarray(np.maximum(extent, LEAST_ASPECT * extent.max()) / extent)


def _frame(ax: Axes3D, maps: LatentMaps, view: tuple[float, float]) -> None:
    low, high = maps.corners
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    drawn = (high - low) * _scales(maps)
    ax.set_box_aspect(tuple(drawn.tolist()), zoom=ZOOM)
    ax.set_proj_type("ortho")
    ax.view_init(*view)
    for number, axis in enumerate((ax.xaxis, ax.yaxis, ax.zaxis)):
        axis.set_label_text(f"$z_{number + 1}$ [1]")
        ticks = max(1, round(4 * drawn[number] / drawn.max()))  # of a short axis, labels would lie on each other
        axis.set_major_locator(MaxNLocator(nbins=ticks, steps=[1, 2, 5, 10]))
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis.line.set_linewidth(0.6)
        axis.labelpad = -6.0
    ax.tick_params(pad=-2.0)
    ax.grid(visible=False)
