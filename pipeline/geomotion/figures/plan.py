"""A planned motion: its way through latent space, where the tool goes, and how it turns (Fig. 3.2, 3.3, 3.6-3.9)."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from matplotlib.ticker import MaxNLocator

from geomotion.figures.latent import LatentMaps, draw_latent, legend_handles, maps_data
from geomotion.figures.style import COLOUR, new_figure, paper_style, save_figure
from geomotion.scores.paths import QUATERNION, PosePath

PROJECTIONS = ((0, 1), (0, 2), (1, 2))
COMPONENTS = {4: ("$q_w$", "$q_x$", "$q_y$", "$q_z$"), 3: ("direction $x$", "direction $y$", "direction $z$")}
CROWD = 3  # legs; more are drawn thinner
LEGEND_MM, PANEL_MM, COMPONENT_MM = 14.0, 66.0, 42.0
GEODESIC: dict[str, Any] = {"color": COLOUR["riemannian"], "linewidth": 1.8, "zorder": 5}
LINE: dict[str, Any] = {"color": COLOUR["euclidean"], "linewidth": 1.2, "linestyle": "--", "zorder": 4}
START: dict[str, Any] = {"marker": "o", "color": COLOUR["riemannian"], "mec": "black", "mew": 0.6, "markersize": 5}
VIA: dict[str, Any] = {"marker": "D", "color": "white", "mec": "black", "mew": 0.6, "markersize": 4}
GOAL: dict[str, Any] = {"marker": "*", "color": "white", "mec": "black", "mew": 0.7, "markersize": 9}


@dataclass(frozen=True)
class ObstacleShape:
    """Surface of an obstacle.

    Attributes:
        name: Of the obstacle.
        vertices: At time zero, in the robot's frame [m]; for planar data an outline.
        faces: Numbers of the vertices of each triangle; empty for an outline.
        way: Displacements over time [m]; one row of zeros if it rests.
    """

    name: str
    vertices: Float[np.ndarray, "vertex D"]
    faces: Int[np.ndarray, "face _"]
    way: Float[np.ndarray, "place D"]

    @property
    def moves(self) -> bool:
        """Whether it is ever elsewhere."""
        return bool(np.ptp(self.way, axis=0).any())

    def polygons(self, plane: tuple[int, int], place: int) -> list[Float[np.ndarray, "_ 2"]]:
        """Its outline, or its triangles projected to a plane [m]; `place` numbers the rows of its way."""
        seen = (self.vertices + self.way[place])[:, plane]
        return list(seen[self.faces]) if len(self.faces) else [seen]


@dataclass(frozen=True)
class PlanPicture:
    """What there is to see of a plan; lists of legs are empty where no path was found.

    Attributes:
        maps: The latent plane; None if latent space is no plane.
        codes: Latent path of each leg, of shape (n, d); a leg that begins where the one before ends goes on with it.
        line: Straight latent line of each leg, of shape (n, d).
        closed: Nodes that obstacles take; None without obstacles.
        demonstrations: All of them.
        held_out: Numbers of those kept from training.
        groups: Group of each demonstration.
        paths: Decoded legs.
        line_paths: Decoded straight line of each leg.
        obstacles: Obstacles.
    """

    maps: LatentMaps | None
    codes: list[Float[np.ndarray, "_ _"]]
    line: list[Float[np.ndarray, "_ _"]]
    closed: Bool[np.ndarray, "nx ny"] | None
    demonstrations: list[PosePath]
    held_out: list[int]
    groups: list[int]
    paths: list[PosePath]
    line_paths: list[PosePath]
    obstacles: list[ObstacleShape]

    @property
    def planes(self) -> tuple[tuple[int, int], ...]:
        """Pairs of axes in which positions are drawn."""
        return PROJECTIONS[:1] if self.demonstrations[0].position_m.shape[1] == 2 else PROJECTIONS

    @property
    def runs(self) -> list[list[int]]:
        """Numbers of legs, together where one goes on with the one before."""
        return in_a_row([path.position_m for path in self.paths])

    @property
    def orientation_dim(self) -> int:
        """Four for quaternions, three for directions."""
        return int(self.demonstrations[0].orientation.shape[1])


@paper_style()
def draw_plan_latent(ax: Axes, picture: PlanPicture) -> Axes:
    """Draw geodesics and straight lines over the magnification factor, nodes taken by obstacles hatched.

    `picture.maps` has to be present.
    """
    assert picture.maps is not None
    draw_latent(ax, picture.maps, "log_magnification")
    if picture.closed is not None and picture.closed.any():
        _hatch(ax, picture.maps, picture.closed)
    _draw_legs(ax, picture.line, picture.codes)
    _mark_ends(ax, picture.codes, picture.runs)  # legs that meet in space may do so at different nodes
    return ax


@paper_style()
def draw_positions(ax: Axes, picture: PlanPicture, plane: tuple[int, int]) -> Axes:
    """Draw where the tool goes, projected to a plane, with demonstrations and obstacles."""
    for obstacle in picture.obstacles:
        draw_obstacle(ax, obstacle, plane)
    for number, demonstration in enumerate(picture.demonstrations):
        _thin(ax, demonstration.position_m[:, plane], number in picture.held_out)
    legs = [path.position_m[:, plane] for path in picture.paths]
    _draw_legs(ax, [path.position_m[:, plane] for path in picture.line_paths], legs)
    _mark_ends(ax, legs, picture.runs)
    label_positions(ax, plane)
    return ax


@paper_style()
def draw_directions(ax: Axes, picture: PlanPicture) -> Axes:
    """Draw directions on the unit sphere, seen from its pole, the z axis (Fig. 3.2)."""
    for number, demonstration in enumerate(picture.demonstrations):
        _thin(ax, demonstration.orientation[:, :2], number in picture.held_out)
    legs = [path.orientation[:, :2] for path in picture.paths]
    _draw_legs(ax, [path.orientation[:, :2] for path in picture.line_paths], legs)
    _mark_ends(ax, legs, picture.runs)
    outline_sphere(ax)
    return ax


@paper_style()
def draw_component(ax: Axes, picture: PlanPicture, axis: int) -> Axes:
    """Draw one component of the orientation over the share of the path; flips of a quaternion's sign stay visible.

    Demonstrated quaternions have the sign that is nearer to the start of the path. Beside legs in a row, which may
    combine demonstrations, they are left out.
    """
    runs = picture.runs
    if all(len(run) == 1 for run in runs):
        for number, demonstration in enumerate(picture.demonstrations):
            curve = _over_share(demonstration, axis) * (1, _sign(picture, demonstration))
            _thin(ax, curve, number in picture.held_out)
    legs, lines = (
        [_over_share(paths[number], axis, place, len(run)) for run in runs for place, number in enumerate(run)]
        for paths in (picture.paths, picture.line_paths)
    )
    _draw_legs(ax, lines, legs)
    for run in runs:
        for joint in range(1, len(run)):
            ax.axvline(joint / len(run), color=COLOUR["field"], linewidth=0.6, zorder=0)
    ax.set(xlabel="share of the path [1]", ylabel=f"{COMPONENTS[picture.orientation_dim][axis]} [1]")
    ax.margins(x=0.01)
    return ax


def draw_obstacle(ax: Axes, obstacle: ObstacleShape, plane: tuple[int, int]) -> Axes:
    """Draw an obstacle's shadow on a plane; of a moving one its first place, its way, and its last place, paler."""
    if obstacle.moves:
        _shadow(ax, obstacle.polygons(plane, -1), strength=0.2)
        centre = obstacle.vertices.mean(axis=0)
        ax.plot(*(centre + obstacle.way)[:, plane].T, ":", color=COLOUR["obstacle"], linewidth=1, zorder=1.5)
    _shadow(ax, obstacle.polygons(plane, 0), strength=0.5)
    return ax


def in_a_row(legs: Sequence[Float[np.ndarray, "_ _"]]) -> list[list[int]]:
    """Numbers of legs, together where each begins at the end of the one before."""
    runs: list[list[int]] = []
    for number, leg in enumerate(legs):
        if number and np.allclose(legs[number - 1][-1], leg[0]):
            runs[-1].append(number)
        else:
            runs.append([number])
    return runs


def label_positions(ax: Axes, plane: tuple[int, int]) -> None:
    """Label the axes of a projection, with equal scales."""
    ax.set(xlabel=f"${'xyz'[plane[0]]}$ [m]", ylabel=f"${'xyz'[plane[1]]}$ [m]")
    ax.set_aspect("equal", adjustable="datalim")
    for direction in (ax.xaxis, ax.yaxis):
        direction.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))


def outline_sphere(ax: Axes) -> None:
    """Label the axes of a view of the unit sphere from its pole, and draw its outline."""
    ax.add_patch(Circle((0, 0), 1, facecolor="none", edgecolor=COLOUR["field"], linewidth=0.6))
    ticks = (-1, -0.5, 0, 0.5, 1)
    ax.set(xlabel="direction $x$ [1]", ylabel="direction $y$ [1]", aspect="equal", xticks=ticks, yticks=ticks)


@paper_style()
def figure_plan(picture: PlanPicture) -> Figure:
    """Latent plane and projections above, components of the orientation below."""
    is_direction = picture.orientation_dim != QUATERNION
    views = (picture.maps is not None) + len(picture.planes) + is_direction
    columns = 2 if views in (2, 4) else 3
    rows = -(-views // columns)
    heights = [PANEL_MM * rows, COMPONENT_MM]
    figure = new_figure(175, LEGEND_MM + sum(heights))
    above, below = figure.subfigures(2, 1, squeeze=False, height_ratios=heights)[:, 0]
    axes = list(above.subplots(rows, columns, squeeze=False).flat)
    if picture.maps is not None:
        draw_plan_latent(axes.pop(0), picture)
    for plane in picture.planes:
        draw_positions(axes.pop(0), picture, plane)
    if is_direction:
        draw_directions(axes.pop(0), picture)
    for ax in axes:
        ax.set_axis_off()
    for axis, ax in enumerate(below.subplots(1, picture.orientation_dim, sharey=True)):
        draw_component(ax, picture, axis)
    figure.legend(handles=_handles(picture), loc="outside upper center", ncols=4)
    return figure


def save_plan_figure(picture: PlanPicture, folder: Path) -> list[str]:
    """Draw a plan into `folder`; returns the names of the files."""
    return save_figure(figure_plan(picture), folder, "plan", plan_data(picture))


def plan_data(picture: PlanPicture) -> dict[str, np.ndarray]:
    """The arrays behind the picture."""
    arrays = {} if picture.maps is None else maps_data(picture.maps)
    if picture.closed is not None:
        arrays["closed"] = picture.closed
    for name, pieces in (("leg", picture.codes), ("line", picture.line)):
        arrays |= {f"{name}_{number}_codes": codes for number, codes in enumerate(pieces)}
    for name, paths in (("leg", picture.paths), ("line", picture.line_paths), ("demo", picture.demonstrations)):
        arrays |= path_data(name, paths)
    for number, obstacle in enumerate(picture.obstacles):
        arrays |= {f"obstacle_{number}_{part}": getattr(obstacle, part) for part in ("vertices", "faces", "way")}
    return arrays


def path_data(name: str, paths: Sequence[PosePath]) -> dict[str, np.ndarray]:
    """Arrays ``<name>_<i>_position_m`` and ``<name>_<i>_orientation``."""
    arrays = {f"{name}_{number}_position_m": path.position_m for number, path in enumerate(paths)}
    return arrays | {f"{name}_{number}_orientation": path.orientation for number, path in enumerate(paths)}


def _thin(ax: Axes, points: Float[np.ndarray, "_ 2"], is_held_out: bool) -> None:
    style: dict[str, Any] = {"linestyle": ":", "linewidth": 0.9} if is_held_out else {"linewidth": 0.5, "alpha": 0.7}
    ax.plot(*points.T, color=COLOUR["demonstration"], zorder=2, **style)


def _over_share(path: PosePath, axis: int, place: int = 0, count: int = 1) -> Float[np.ndarray, "_ 2"]:
    """Share of the whole path and component of the orientation; the path is one of `count` legs in a row."""
    shares = (place + np.linspace(0, 1, len(path))) / count
    return np.stack([shares, path.orientation[:, axis]], axis=1)


def _draw_legs(
    ax: Axes, lines: Sequence[Float[np.ndarray, "_ 2"]], geodesics: Sequence[Float[np.ndarray, "_ 2"]]
) -> None:
    for curves, look in ((lines, LINE), (geodesics, GEODESIC)):
        width = look["linewidth"] if len(curves) <= CROWD else look["linewidth"] / 2
        for curve in curves:
            ax.plot(*curve.T, **look | {"linewidth": width})


def _mark_ends(ax: Axes, legs: Sequence[Float[np.ndarray, "_ 2"]], runs: Sequence[Sequence[int]]) -> None:
    """Start and goal of every row of legs, and where two of them meet."""
    for run in runs:
        ax.plot(*legs[run[0]][0], **START, zorder=6)
        for number in run[1:]:
            ax.plot(*legs[number][0], **VIA, zorder=6)
        ax.plot(*legs[run[-1]][-1], **GOAL, zorder=7)


def _hatch(ax: Axes, maps: LatentMaps, closed: Bool[np.ndarray, "nx ny"]) -> None:
    taken = closed.T.astype(float)
    hatched = ax.contourf(*maps.axes, taken, levels=[0.5, 1.5], colors="none", hatches=["/////"], zorder=1.5)
    hatched.set(edgecolor=COLOUR["obstacle"], linewidth=0)
    if not closed.all():
        ax.contour(*maps.axes, taken, levels=[0.5], colors=COLOUR["obstacle"], linewidths=0.9, zorder=1.5)


def _sign(picture: PlanPicture, demonstration: PosePath) -> float:
    """Of a demonstrated quaternion, such that it begins near the path."""
    if picture.orientation_dim != QUATERNION or not picture.paths:
        return 1.0
    return 1.0 if demonstration.orientation[0] @ picture.paths[0].orientation[0] >= 0 else -1.0


def _shadow(ax: Axes, polygons: Sequence[Float[np.ndarray, "_ 2"]], strength: float) -> None:
    """Polygons in one opaque pale colour: transparent triangles would darken each other."""
    colour = tuple(1 - strength * (1 - part) for part in to_rgb(COLOUR["obstacle"]))
    shadow = PolyCollection(polygons, facecolor=colour, edgecolor=colour, linewidth=0.3, zorder=1, rasterized=True)
    ax.add_collection(shadow)


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
    if picture.closed is not None and picture.closed.any():
        handles += [Patch(facecolor="none", edgecolor=COLOUR["obstacle"], hatch="/////", label="taken by obstacles")]
    return handles + (legend_handles(picture.maps) if picture.maps is not None else [])
