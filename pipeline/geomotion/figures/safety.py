"""Safety regions of a latent plane: switching, from volume to distance, and motions with and without (Fig. 6.3-6.5)."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from geomotion.figures.latent import label_latent
from geomotion.figures.style import COLOUR, limit_to, new_figure, panel_size_mm, paper_style, save_figure

SIDE_MM = 58.0
LEGEND_MM, LABELS_MM, TITLE_MM = 14.0, 16.0, 10.0
DECADES = 2.0  # of S and of the volume around their levels that greys tell apart
STREAMS = 0.9
NodeValues = Float[np.ndarray, "n n"]
Rollouts = Float[np.ndarray, "start time 2"]


@runtime_checkable
class RegionMap(Protocol):
    """What there is to see of a region alone; see :class:`SafetyPicture`."""

    @property
    def axes(self) -> Float[np.ndarray, "2 n"]: ...
    @property
    def distance(self) -> NodeValues: ...
    @property
    def levels(self) -> Float[np.ndarray, " 3"]: ...
    @property
    def is_inside(self) -> Bool[np.ndarray, "n n"]: ...


@dataclass(frozen=True)
class SafetyPicture:
    """What there is to see of a safety region.

    Attributes:
        axes: Grid coordinates along both latent axes.
        volume: √det M over that of the means, obstacles included.
        distance: S.
        levels: ρ, ν and k.
        is_inside: Nodes whose position is in an obstacle.
        switching: S, λ_n and λ_τ, one row each.
        codes: Encoded demonstrations.
        geodesic: Shortest way from the start of the first demonstration to the goal.
        goal: Latent point, shape (2,).
        free: Rollouts of the field as it was learned.
        safe: The same starts, followed in the region.
        unhelped: The same without the tangential field.
        misled: The same along the other tangent.
        free_flow: Velocities of the first at the nodes.
        safe_flow: Of the second.
    """

    axes: Float[np.ndarray, "2 n"]
    volume: NodeValues
    distance: NodeValues
    levels: Float[np.ndarray, " 3"]
    is_inside: Bool[np.ndarray, "n n"]
    switching: Float[np.ndarray, "3 _"]
    codes: Sequence[Float[np.ndarray, "_ 2"]]
    geodesic: Float[np.ndarray, "_ 2"]
    goal: Float[np.ndarray, " 2"]
    free: Rollouts
    safe: Rollouts
    unhelped: Rollouts
    misled: Rollouts
    free_flow: Float[np.ndarray, "n n 2"]
    safe_flow: Float[np.ndarray, "n n 2"]

    @property
    def safe_nodes(self) -> Float[np.ndarray, "_ 2"]:
        """Where S > ρ."""
        row, column = np.nonzero(self.distance > self.levels[0])
        return np.stack([self.axes[0][row], self.axes[1][column]], axis=1)

    def arrays(self) -> dict[str, np.ndarray]:
        """All of it, for the file beside the pictures."""
        named = {item.name: getattr(self, item.name) for item in fields(self) if item.name != "codes"}
        return named | {f"codes_{number}": one for number, one in enumerate(self.codes)}


@paper_style()
def figure_switching(picture: SafetyPicture) -> Figure:
    """λ_n and λ_τ over the distance S, Fig. 6.3."""
    figure = new_figure(80, 55)
    ax = figure.subplots()
    distance, across, along = picture.switching
    ax.plot(distance, along, color=COLOUR["riemannian"], label=r"$\lambda_\tau$")
    ax.plot(distance, across, color=COLOUR["rollout"], label=r"$\lambda_n$")
    for level, name in zip(picture.levels[:2], (r"$\rho$", r"$\nu$"), strict=True):
        ax.axvline(level, color=COLOUR["euclidean"], linewidth=0.6, linestyle=":")
        ax.annotate(name, (level, 2.1), ha="center", annotation_clip=False)
    ax.set(xlabel="distance $S$ [1]", ylabel="eigenvalue of the modulation [1]", ylim=(-0.05, 2.05))
    ax.legend()
    return figure


@paper_style()
def figure_distance(picture: SafetyPicture) -> Figure:
    """From obstacle to distance, Fig. 6.4: what is unsafe, the volume, and S with its levels ρ and ν."""
    figure = new_figure(3 * SIDE_MM, SIDE_MM + 6)
    unsafe, volume, distance = figure.subplots(1, 3)
    unsafe.pcolormesh(*picture.axes, picture.is_inside.T, cmap="Greys", vmax=2, shading="nearest", rasterized=True)
    unsafe.set_title("positions in obstacles")
    values = np.log10(picture.volume)
    middle = float(np.log10(picture.volume[picture.distance > picture.levels[0]].max()))
    _shade(
        figure, volume, picture, values, (middle - 2 * DECADES, middle + DECADES), r"$\log_{10}$ volume [1]", "Greys"
    )
    volume.set_title("volume of the metric")
    draw_region(figure, distance, picture)
    distance.set_title("calibrated distance $S$")
    for ax in (unsafe, volume, distance):
        _demonstrations(ax, picture)
        label_latent(ax)
        limit_to(ax, picture.safe_nodes)
        ax.label_outer()
    return figure


@paper_style()
def figure_safe_motion(picture: SafetyPicture) -> Figure:
    """The field and motions without the region and in it, Fig. 6.5 and 6.17."""
    width_mm, height_mm = panel_size_mm(picture.safe_nodes, SIDE_MM)
    rows, columns = (1, 4) if height_mm > width_mm else (2, 2)
    figure = new_figure(columns * width_mm + LABELS_MM, rows * (height_mm + TITLE_MM) + LEGEND_MM)
    panels = figure.subplots(rows, columns)
    shown = (
        ("as learned", picture.free, picture.free_flow),
        ("modulated, Eq. (6.5)", picture.unhelped, None),
        ("helped against the geodesic", picture.misled, None),
        ("helped along it, Eq. (6.9)", picture.safe, picture.safe_flow),
    )
    for ax, (title, rollouts, flow) in zip(panels.flat, shown, strict=True):
        draw_region(figure, ax, picture, has_bar=False)
        if flow is not None:
            velocity = np.moveaxis(flow, 1, 0)
            x, y = (np.linspace(axis[0], axis[-1], len(axis)) for axis in picture.axes)
            ax.streamplot(x, y, *np.moveaxis(velocity, -1, 0), color=COLOUR["euclidean"], linewidth=0.3, arrowsize=0.4,
                          density=STREAMS, zorder=1)  # fmt: skip
        _demonstrations(ax, picture)
        ax.plot(rollouts[..., 0].T, rollouts[..., 1].T, color=COLOUR["grid"], linewidth=0.5, zorder=3)
        ax.plot(*rollouts[:, 0].T, ".", color=COLOUR["grid"], markersize=2.5, zorder=3)
        ax.plot(*rollouts[:, -1].T, "o", color=COLOUR["expanding"], markersize=3, zorder=3.5)
        ax.plot(*picture.goal, "*", color="white", mec="black", mew=0.7, markersize=9, zorder=5)
        ax.set_title(title)
        label_latent(ax)
        limit_to(ax, picture.safe_nodes)
        ax.label_outer()
    panels.flat[-1].plot(*picture.geodesic.T, color=COLOUR["riemannian"], linewidth=1.4, zorder=4)
    figure.legend(handles=_legend(), loc="outside lower center", ncols=3)
    return figure


def draw_region(figure: Figure, ax: Axes, picture: RegionMap, has_bar: bool = True) -> None:
    """Grey over log S, dark where it is unsafe, with lines at ρ and ν, and obstacles outlined."""
    rho, nu, _ = np.log10(picture.levels)
    values = np.log10(picture.distance)
    label = r"$\log_{10} S$ [1]" if has_bar else None
    _shade(figure, ax, picture, values, (rho - DECADES / 2, nu), label, "gray")
    ax.contour(*picture.axes, values.T, levels=[rho], colors=COLOUR["obstacle"], linewidths=1.0, zorder=2)
    ax.contour(
        *picture.axes, values.T, levels=[nu], colors=COLOUR["obstacle"], linewidths=0.6, linestyles="--", zorder=2
    )
    if picture.is_inside.any():
        ax.contourf(*picture.axes, picture.is_inside.T.astype(float), levels=[0.5, 1.5], colors=COLOUR["obstacle"])


def save_safety_figures(picture: SafetyPicture, folder: Path) -> None:
    """Write all three."""
    drawn = {
        "safety_switching": figure_switching(picture),
        "safety_distance": figure_distance(picture),
        "safety_motion": figure_safe_motion(picture),
    }
    for name, figure in drawn.items():
        save_figure(figure, folder, name, picture.arrays())


def _shade(
    figure: Figure,
    ax: Axes,
    picture: RegionMap,
    values: NodeValues,
    limits: tuple[float, float],
    label: str | None,
    colourmap: str,
) -> None:
    image = ax.pcolormesh(
        *picture.axes, values.T, cmap=colourmap, vmin=limits[0], vmax=limits[1], shading="nearest", rasterized=True
    )
    if label is not None:
        figure.colorbar(image, ax=ax, label=label, extend="both", shrink=0.8)


def _demonstrations(ax: Axes, picture: SafetyPicture) -> None:
    for one in picture.codes:
        ax.plot(*one.T, color=COLOUR["demonstration"], linewidth=0.6, zorder=2.5)


def _legend() -> list[Line2D]:
    def line(label: str, **style: Any) -> Line2D:
        return Line2D([], [], label=label, **style)

    return [
        line("encoded demonstrations", color=COLOUR["demonstration"], linewidth=0.6),
        line("motions from random starts", color=COLOUR["grid"], linewidth=0.9),
        line("where they end", color=COLOUR["expanding"], marker="o", markersize=3, linestyle=""),
        line("$S = \\rho$, and obstacles", color=COLOUR["obstacle"], linewidth=1.0),
        line("$S = \\nu$", color=COLOUR["obstacle"], linewidth=0.6, linestyle="--"),
        line("geodesic", color=COLOUR["riemannian"], linewidth=1.4),
    ]
