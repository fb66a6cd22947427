"""Panels of a planned motion: its way through latent space, where the tool goes, how it turns, what joints do."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D

from geomotion.figures.joints import label_joint
from geomotion.figures.latent import LatentMaps, draw_latent, group_colour
from geomotion.figures.latent_space import draw_latent_space
from geomotion.figures.plan_picture import ArmPoses, ObstacleShape, PlanPicture
from geomotion.figures.style import COLOUR, paper_style
from geomotion.figures.tubes import tubes_of
from geomotion.scores.paths import QUATERNION, MotionPath

COMPONENTS = {4: ("$q_w$", "$q_x$", "$q_y$", "$q_z$"), 3: ("direction $x$", "direction $y$", "direction $z$")}
CROWD = 3  # legs; more are drawn thinner
GEODESIC: dict[str, Any] = {"color": COLOUR["riemannian"], "linewidth": 1.8, "zorder": 5}
LINE: dict[str, Any] = {"color": COLOUR["euclidean"], "linewidth": 1.2, "linestyle": "--", "zorder": 4}
ARM: dict[str, Any] = {"linewidth": 1.2, "alpha": 0.35, "zorder": 1.8, "marker": "o", "markersize": 1.5}
START: dict[str, Any] = {"marker": "o", "color": COLOUR["riemannian"], "mec": "black", "mew": 0.6, "markersize": 5}
VIA: dict[str, Any] = {"marker": "D", "color": "white", "mec": "black", "mew": 0.6, "markersize": 4}
GOAL: dict[str, Any] = {"marker": "*", "color": "white", "mec": "black", "mew": 0.7, "markersize": 9}


@paper_style()
def draw_plan_latent(ax: Axes, picture: PlanPicture) -> Axes:
    """Draw geodesics and straight lines over the magnification factor, with what obstacles take of the latent space.

    A plane is drawn with nodes that obstacles take hatched, and a space, on axes of three dimensions, as its tubes.
    """
    if isinstance(ax, Axes3D):
        draw_latent_space(ax, picture.maps, tubes_of(picture.maps), closed=picture.closed)
    else:
        draw_latent(ax, picture.maps, "log_magnification")
        if picture.closed is not None and picture.has_closed:
            _hatch(ax, picture.maps, picture.closed)
    _draw_legs(ax, picture.line, picture.codes)
    _mark_ends(ax, picture.codes, picture.runs)  # legs that meet in space may do so at different nodes
    return ax


@paper_style()
def draw_positions(ax: Axes, picture: PlanPicture, plane: tuple[int, int]) -> Axes:
    """Draw where the tool goes, projected to a plane, with demonstrations and obstacles, and the arm that does it."""
    for obstacle in picture.obstacles:
        draw_obstacle(ax, obstacle, plane)
    if picture.arm is not None and len(picture.planes) == 1:
        for group, poses in picture.arm.demonstrated.items():
            _draw_arm(ax, poses, plane, group_colour(group, picture.groups))
    if picture.arm is not None and picture.shows_arm:
        for poses in picture.arm.along:
            _draw_arm(ax, poses, plane, COLOUR["riemannian"])
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
    demonstrated = [_sign(picture, one) * one.orientation[:, axis] for one in picture.demonstrations]
    legs, lines = ([path.orientation[:, axis] for path in paths] for paths in (picture.paths, picture.line_paths))
    _draw_over_share(ax, picture, demonstrated, legs, lines)
    ax.set(xlabel="share of the path [1]", ylabel=f"{COMPONENTS[picture.orientation_dim][axis]} [1]")
    ax.margins(x=0.01)
    return ax


@paper_style()
def draw_joint(ax: Axes, picture: PlanPicture, joint: int) -> Axes:
    """Draw one joint over the share of the path, with its limits where they are near.

    `picture.arm` has to be present. Demonstrations are left out as in :func:`draw_component`.
    """
    assert picture.arm is not None
    pieces = (picture.demonstrations, picture.paths, picture.line_paths)
    demonstrated, legs, lines = ([path.vectors[:, joint] for path in paths] for paths in pieces)
    _draw_over_share(ax, picture, demonstrated, legs, lines)
    label_joint(ax, picture.arm.joints, joint, [*demonstrated, *legs])
    return ax


def draw_obstacle(ax: Axes, obstacle: ObstacleShape, plane: tuple[int, int]) -> Axes:
    """Draw an obstacle's shadow on a plane; of a moving one its first place, its way, and its last place, paler."""
    if obstacle.moves:
        _shadow(ax, obstacle.polygons(plane, -1), strength=0.2)
        centre = obstacle.vertices.mean(axis=0)
        ax.plot(*(centre + obstacle.way)[:, plane].T, ":", color=COLOUR["obstacle"], linewidth=1, zorder=1.5)
    _shadow(ax, obstacle.polygons(plane, 0), strength=0.5)
    return ax


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


def _thin(ax: Axes, points: Float[np.ndarray, "_ 2"], is_held_out: bool) -> None:
    style: dict[str, Any] = {"linestyle": ":", "linewidth": 0.9} if is_held_out else {"linewidth": 0.5, "alpha": 0.7}
    ax.plot(*points.T, color=COLOUR["demonstration"], zorder=2, **style)


def _draw_over_share(
    ax: Axes,
    picture: PlanPicture,
    demonstrated: Sequence[Float[np.ndarray, " _"]],
    legs: Sequence[Float[np.ndarray, " _"]],
    lines: Sequence[Float[np.ndarray, " _"]],
) -> None:
    """Values along demonstrations, geodesics and straight lines; legs in a row share the axis."""
    runs = picture.runs
    if all(len(run) == 1 for run in runs):
        for number, values in enumerate(demonstrated):
            _thin(ax, _over_share(values), number in picture.held_out)
    curves = (
        [_over_share(values[number], place, len(run)) for run in runs for place, number in enumerate(run)]
        for values in (lines, legs)
    )
    _draw_legs(ax, *curves)
    for run in runs:
        for meeting in range(1, len(run)):
            ax.axvline(meeting / len(run), color=COLOUR["field"], linewidth=0.6, zorder=0)


def _over_share(values: Float[np.ndarray, " _"], place: int = 0, count: int = 1) -> Float[np.ndarray, "_ 2"]:
    """Share of the whole path and values along it; the path is one of `count` legs in a row."""
    return np.stack([(place + np.linspace(0, 1, len(values))) / count, values], axis=1)


def _draw_arm(ax: Axes, poses: ArmPoses, plane: tuple[int, int], colour: str) -> None:
    for pose in poses:
        ax.plot(*pose[:, plane].T, color=colour, **ARM)


def _draw_legs(
    ax: Axes, lines: Sequence[Float[np.ndarray, "_ _"]], geodesics: Sequence[Float[np.ndarray, "_ _"]]
) -> None:
    for curves, look in ((lines, LINE), (geodesics, GEODESIC)):
        width = look["linewidth"] if len(curves) <= CROWD else look["linewidth"] / 2
        for curve in curves:
            ax.plot(*curve.T, **look | {"linewidth": width})


def _mark_ends(ax: Axes, legs: Sequence[Float[np.ndarray, "_ _"]], runs: Sequence[Sequence[int]]) -> None:
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


def _sign(picture: PlanPicture, demonstration: MotionPath) -> float:
    """Of a demonstrated quaternion, such that it begins near the path."""
    if picture.orientation_dim != QUATERNION or not picture.paths:
        return 1.0
    return 1.0 if demonstration.orientation[0] @ picture.paths[0].orientation[0] >= 0 else -1.0


def _shadow(ax: Axes, polygons: Sequence[Float[np.ndarray, "_ 2"]], strength: float) -> None:
    """Polygons in one opaque pale colour: transparent triangles would darken each other."""
    colour = tuple(1 - strength * (1 - part) for part in to_rgb(COLOUR["obstacle"]))
    shadow = PolyCollection(polygons, facecolor=colour, edgecolor=colour, linewidth=0.3, zorder=1, rasterized=True)
    ax.add_collection(shadow)
