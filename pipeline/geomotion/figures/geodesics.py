"""Geodesics between the ends of demonstrations, judged against those demonstrations and a simple baseline."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from geomotion.figures.joints import JOINT_MM, LIMIT, JointAxes, label_joint, rows_of
from geomotion.figures.plan import path_data
from geomotion.figures.plan_panels import label_positions, outline_sphere
from geomotion.figures.plan_picture import planes_of
from geomotion.figures.style import COLOUR, new_figure, paper_style, save_figure
from geomotion.scores.paths import DIRECTION, MotionPath

LEGEND_MM, PANEL_MM, RATIO_MM = 12.0, 68.0, 48.0
TRAINING: dict[str, Any] = {"color": COLOUR["field"], "linewidth": 0.6, "zorder": 1}
DEMONSTRATION: dict[str, Any] = {"color": COLOUR["demonstration"], "linewidth": 1.2, "zorder": 2}
LINE: dict[str, Any] = {"color": COLOUR["euclidean"], "linewidth": 1.0, "linestyle": (0, (2, 1.5)), "zorder": 3}
AVERAGED: dict[str, Any] = {"color": COLOUR["rollout"], "linewidth": 1.4, "linestyle": (0, (5, 1.5)), "zorder": 4}
GEODESIC: dict[str, Any] = {"color": COLOUR["riemannian"], "linewidth": 1.8, "zorder": 5}
RATIO_DOT: dict[str, Any] = {"color": COLOUR["riemannian"], "marker": "o", "markersize": 6, "linestyle": ""}
AVERAGED_DOT: dict[str, Any] = {
    "marker": "s",
    "markersize": 5,
    "linestyle": "",
    "markerfacecolor": "white",
    "markeredgecolor": COLOUR["rollout"],
    "markeredgewidth": 1.4,
}


@dataclass(frozen=True)
class JudgedGeodesic:
    """A demonstration, and what leads from its start to its goal.

    Attributes:
        number: Of the demonstration.
        demonstration: The demonstration.
        geodesic: Planned path; None where there is none.
        averaged: Mean of the training demonstrations with blended ends.
        line: Decoded straight latent line; None where there is none.
        ratio: DTWD of the geodesic over that between demonstrations, by part; not a number without one.
        averaged_ratio: The same of the averaged demonstration.
    """

    number: int
    demonstration: MotionPath
    geodesic: MotionPath | None
    averaged: MotionPath
    line: MotionPath | None
    ratio: Mapping[str, float]
    averaged_ratio: Mapping[str, float]

    def ratios(self, part: str) -> tuple[float, float]:
        """Of the geodesic, and of the averaged demonstration."""
        return self.ratio[part], self.averaged_ratio[part]


@paper_style()
def draw_geodesics(
    ax: Axes, judged: Sequence[JudgedGeodesic], training: Sequence[MotionPath], plane: tuple[int, int]
) -> Axes:
    """Draw positions projected to a plane."""
    for path, look in _layers(judged, training):
        ax.plot(*path.position_m[:, plane].T, **look)
    label_positions(ax, plane)
    return ax


@paper_style()
def draw_geodesic_directions(ax: Axes, judged: Sequence[JudgedGeodesic], training: Sequence[MotionPath]) -> Axes:
    """Draw directions on the unit sphere, seen from its pole."""
    for path, look in _layers(judged, training):
        ax.plot(*path.orientation[:, :2].T, **look)
    outline_sphere(ax)
    return ax


@paper_style()
def draw_geodesic_joint(
    ax: Axes, judged: Sequence[JudgedGeodesic], training: Sequence[MotionPath], joints: JointAxes, joint: int
) -> Axes:
    """Draw one joint over the share of the path."""
    shown = []
    for path, look in _layers(judged, training):
        shown.append(path.vectors[:, joint])
        ax.plot(np.linspace(0, 1, len(path)), shown[-1], **look)
    label_joint(ax, joints, joint, shown)
    return ax


@paper_style()
def draw_ratios(ax: Axes, judged: Sequence[JudgedGeodesic], part: str) -> Axes:
    """Draw the DTWD ratio of each geodesic beside that of the averaged demonstration, which it has to beat."""
    places = np.arange(len(judged))
    ratios = np.array([one.ratios(part) for one in judged], dtype=float)
    ax.axhline(1, color=COLOUR["euclidean"], linestyle="--", linewidth=0.8, zorder=0)
    ax.vlines(places, ratios.min(axis=1), ratios.max(axis=1), color=COLOUR["field"], linewidth=1, zorder=1)
    ax.plot(places, ratios[:, 1], **AVERAGED_DOT, zorder=2)
    ax.plot(places, ratios[:, 0], **RATIO_DOT, zorder=3)
    for place in places[np.isnan(ratios[:, 0])]:
        ax.annotate("no path", (place, 0.02), xycoords=("data", "axes fraction"), rotation=90, ha="right", fontsize=7)
    known = ratios[np.isfinite(ratios)]
    ax.set(xlim=(-0.6, len(judged) - 0.4), ylim=(0, 1.12 * max(1.0, known.max(initial=0.0))))
    ax.set_xticks(places, [str(one.number) for one in judged])
    ax.set(xlabel="demonstration [1]", ylabel="DTWD ratio [1]", title=f"{part}\n{_means(ratios)}")
    return ax


def widest_planes(paths: Sequence[MotionPath], count: int = 2) -> list[tuple[int, int]]:
    """The planes in which motions are seen best: along the axis of their largest extent and each of the others."""
    extent = np.ptp(np.concatenate([path.position_m for path in paths]), axis=0)
    longest = int(extent.argmax())
    planes = [plane for plane in planes_of(paths) if longest in plane]
    return sorted(planes, key=lambda plane: -extent[list(plane)].min())[:count]


@paper_style()
def figure_geodesics(
    judged: list[JudgedGeodesic], training: list[MotionPath], joints: JointAxes | None = None
) -> Figure:
    """Paths of the end effector above, joints if there are any, and ratios of each part below."""
    paths = [*training, *(one.demonstration for one in judged)]
    planes, has_directions = widest_planes(paths), joints is None and paths[0].orientation.shape[1] == DIRECTION
    views, parts = len(planes) + has_directions, list(judged[0].ratio)
    joint_rows = 0 if joints is None else rows_of(len(joints.names))[0]
    heights = [PANEL_MM, *[joint_rows * JOINT_MM] * bool(joint_rows), RATIO_MM]
    figure = new_figure(175, LEGEND_MM + sum(heights))
    above, *between, below = figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
    axes = above.subplots(1, views, squeeze=False)[0]
    for ax, plane in zip(axes, planes, strict=False):
        draw_geodesics(ax, judged, training, plane)
    if has_directions:
        draw_geodesic_directions(axes[-1], judged, training)
    if joints is not None:
        for joint in range(len(joints.names)):
            ax = between[0].add_subplot(*rows_of(len(joints.names)), 1 + joint)
            draw_geodesic_joint(ax, judged, training, joints, joint)
    for ax, part in zip(below.subplots(1, len(parts), squeeze=False)[0], parts, strict=True):
        draw_ratios(ax, judged, part)
    figure.legend(handles=_handles(judged, training, joints), loc="outside upper center", ncols=4)
    return figure


def save_geodesics_figure(
    judged: list[JudgedGeodesic], training: list[MotionPath], folder: Path, joints: JointAxes | None = None
) -> list[str]:
    """Draw judged geodesics into `folder`; returns the names of the files.

    Args:
        judged: One or more.
        training: Demonstrations that were trained on.
        folder: Where to.
        joints: Of the arm, if the paths are of its configurations.
    """
    return save_figure(figure_geodesics(judged, training, joints), folder, "geodesics", _data(judged, training))


def _layers(
    judged: Sequence[JudgedGeodesic], training: Sequence[MotionPath]
) -> Iterator[tuple[MotionPath, dict[str, Any]]]:
    """Every path that there is with its look, the important ones last."""
    yield from ((path, TRAINING) for path in training)
    looks = {"demonstration": DEMONSTRATION, "line": LINE, "averaged": AVERAGED, "geodesic": GEODESIC}
    for name, look in looks.items():
        paths = (getattr(one, name) for one in judged)
        yield from ((path, look) for path in paths if path is not None)


def _data(judged: Sequence[JudgedGeodesic], training: Sequence[MotionPath]) -> dict[str, np.ndarray]:
    arrays = path_data("training", dict(enumerate(training)))
    for one in judged:
        for name in ("demonstration", "geodesic", "averaged", "line"):
            path = getattr(one, name)
            if path is not None:
                arrays |= path_data(name, {one.number: path})
    arrays["numbers"] = np.array([one.number for one in judged], dtype=int)
    return arrays | {f"{part}_ratios": np.array([one.ratios(part) for one in judged]) for part in judged[0].ratio}


def _means(ratios: np.ndarray) -> str:
    """Means over the geodesics that there are; of the baseline over the same demonstrations."""
    found = ratios[np.isfinite(ratios[:, 0])]
    if not len(found):
        return "no path found"
    own, averaged = found.mean(axis=0)
    return f"mean {own:.2f}; averaged demo {averaged:.2f}"


def _handles(
    judged: Sequence[JudgedGeodesic], training: Sequence[MotionPath], joints: JointAxes | None
) -> list[Line2D]:
    looks: dict[str, tuple[bool, dict[str, Any]]] = {
        "geodesic": (True, GEODESIC | {"marker": "o", "markersize": 5}),
        "averaged demonstration": (True, AVERAGED_DOT | AVERAGED),
        "judged demonstration": (True, DEMONSTRATION),
        "straight latent line": (any(one.line is not None for one in judged), LINE),
        "training demonstration": (bool(training), TRAINING),
        "another demonstration instead: 1": (
            True,
            {"color": COLOUR["euclidean"], "linestyle": "--", "linewidth": 0.8},
        ),
        "joint limit": (joints is not None, LIMIT),
    }
    return [Line2D([], [], label=name, **look) for name, (is_drawn, look) in looks.items() if is_drawn]
