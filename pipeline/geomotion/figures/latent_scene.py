"""A latent space of three dimensions to turn and zoom: its tubes, demonstrations, and geodesics in them (Fig. 4.7)."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float

from geomotion.figures.isosurface import Mesh
from geomotion.figures.latent import LatentMaps, group_colour, group_names
from geomotion.figures.style import COLOUR
from geomotion.figures.traces3d import arrange, legs, named_once, polylines, save_page, surface
from geomotion.figures.tubes import obstructed, tubes_of

if TYPE_CHECKING:
    from plotly.graph_objects import Figure, Mesh3d

CELLS_PER_AXIS = 28  # of a surface: a finer one would make the page large and slow to turn
POINTS_PER_CODES = 60  # of a demonstration
WALL = "#BDBDBD"
Codes = Float[np.ndarray, "_ 3"]


def save_latent_scene(
    maps: LatentMaps,
    path: Path,
    geodesics: Sequence[Codes] = (),
    lines: Sequence[Codes] = (),
    closed: Bool[np.ndarray, "nx ny nz"] | None = None,
) -> None:
    """Write the latent space as HTML that needs nothing else.

    Args:
        maps: In three dimensions.
        path: Where to; whole or absent.
        geodesics: Latent paths, one after the other.
        lines: Straight latent lines.
        closed: Nodes that obstacles take.

    Raises:
        DiskFull: If space ran out.
    """
    save_page(latent_scene(maps, geodesics, lines, closed), path)


def latent_scene(
    maps: LatentMaps,
    geodesics: Sequence[Codes] = (),
    lines: Sequence[Codes] = (),
    closed: Bool[np.ndarray, "nx ny nz"] | None = None,
) -> "Figure":
    """The latent space with everything in it; arguments as in :func:`save_latent_scene`."""
    from plotly.subplots import make_subplots

    tubes = tubes_of(maps)
    traces: list[Any] = [_surface(tubes.wall, f"walls, log √det M = {tubes.level:.1f}", WALL, opacity=0.25)]
    if closed is not None:
        taken = obstructed(maps, tubes, closed)
        traces.append(_surface(taken, "taken by obstacles", COLOUR["obstacle"], opacity=0.9))
    for group, name in group_names(maps.groups).items():
        own = [_sparse(codes) for codes, of in zip(maps.codes, maps.groups, strict=True) if of == group]
        traces.append(polylines(own, name, group_colour(group, maps.groups), 2))
    traces += legs(geodesics, lines)
    figure = make_subplots(1, 1, specs=[[{"type": "scene"}]], subplot_titles=["latent space"])
    figure.add_traces(named_once(traces), rows=1, cols=1)
    arrange(figure, ("z₁ [1]", "z₂ [1]", "z₃ [1]"))
    return figure


def _surface(mesh: Mesh, name: str, colour: str, opacity: float) -> "Mesh3d":
    """In as few bytes as do."""
    coarse = mesh.simplified(CELLS_PER_AXIS)
    faces = coarse.faces.astype(np.min_scalar_type(len(coarse.vertices)))
    return surface(coarse.vertices.astype(np.float32), faces, name, colour, opacity)


def _sparse(codes: Codes) -> Codes:
    chosen = np.unique(np.linspace(0, len(codes) - 1, POINTS_PER_CODES).round().astype(int))
    return np.asarray(codes[chosen], dtype=np.float32)
