"""The latent plane of a manifold: how sure the decoder is, and how much it stretches (Fig. 3.1, 4.1)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from geomotion.figures.style import COLOUR, SEQUENCE, new_figure, panel_size_mm, paper_style, save_figure

Quantity = Literal["log_std", "log_magnification"]

LABELS: Mapping[Quantity, str] = MappingProxyType(
    {"log_std": r"$\log_{10}$ ($\sigma$ / data size) [1]", "log_magnification": r"$\log\,\sqrt{\det M}$ [1]"}
)
TITLES: Mapping[Quantity, str] = MappingProxyType(
    {"log_std": "variance measure", "log_magnification": "magnification factor"}
)
COLOURMAP = LinearSegmentedColormap.from_list(
    "pale greys", ["white", "0.45"]
)  # colours and black are for what lies on it
PERCENTILES = (1.0, 99.0)  # of the values: beyond them the colour scale is cut
BAR_PLACE = (1.04, 0.0, 0.045, 1.0)  # beside the axes, in shares of their size
GROUP_COLOURS = tuple(SEQUENCE[number] for number in (1, 4, 5, 2))  # neither a geodesic's nor an obstacle's
SIDE_MM, BAR_MM, LEGEND_MM = 72.0, 22.0, 12.0


@dataclass(frozen=True)
class LatentMaps:
    """A latent plane or space on a grid, with the demonstrations in it.

    Attributes:
        axes: Grid coordinates along each latent axis [-].
        log_std: Base-10 logarithm of the decoder's standard deviation over the size of the data.
        log_magnification: Natural logarithm of √det M.
        within: Nodes inside the support cap.
        codes: Encoded training demonstrations, each of shape (n, d).
        other_codes: Codes of their antipodal copies; may be empty.
        groups: Group of each demonstration.
    """

    axes: tuple[Float[np.ndarray, " _"], ...]
    log_std: Float[np.ndarray, "*shape"]
    log_magnification: Float[np.ndarray, "*shape"]
    within: Bool[np.ndarray, "*shape"]
    codes: list[Float[np.ndarray, "_ d"]]
    other_codes: Float[np.ndarray, "_ d"]
    groups: list[int]

    @property
    def dim(self) -> int:
        """d."""
        return len(self.axes)

    @property
    def corners(self) -> Float[np.ndarray, "2 d"]:
        """Lowest and highest latent coordinates."""
        return np.array([[axis[end] for axis in self.axes] for end in (0, -1)])


def group_colour(group: int, groups: Sequence[int]) -> str:
    """Black where there is one group, otherwise a colour for each."""
    known = sorted(set(groups))
    if len(known) < 2:
        return COLOUR["demonstration"]
    return GROUP_COLOURS[known.index(group) % len(GROUP_COLOURS)]


def group_names(groups: Sequence[int]) -> dict[int, str]:
    """What legends call the encoded demonstrations of each group."""
    known = sorted(set(groups))
    if len(known) < 2:
        return dict.fromkeys(known, "encoded demonstrations")
    return {group: f"demonstrations, group {group}" for group in known}


@paper_style()
def draw_latent(ax: Axes, maps: LatentMaps, which: Quantity = "log_std") -> Axes:
    """Draw a quantity over the latent plane with its colour bar, the encoded demonstrations and the support cap.

    Args:
        ax: Where to draw.
        maps: The plane.
        which: Variance measure or magnification factor.
    """
    values = getattr(maps, which)
    low, high = np.percentile(values[np.isfinite(values)], PERCENTILES)
    image = ax.pcolormesh(*maps.axes, values.T, cmap=COLOURMAP, vmin=low, vmax=high, shading="nearest", rasterized=True)
    ax.figure.colorbar(image, cax=ax.inset_axes(BAR_PLACE), label=LABELS[which], extend="both")
    draw_support_cap(ax, maps)
    draw_codes(ax, maps)
    label_latent(ax)
    ax.set(title=TITLES[which])
    return ax


def label_latent(ax: Axes) -> None:
    """Label the axes of a latent plane, with equal scales."""
    ax.set(xlabel="$z_1$ [1]", ylabel="$z_2$ [1]", aspect="equal")
    for direction in (ax.xaxis, ax.yaxis):
        direction.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))


def draw_support_cap(ax: Axes, maps: LatentMaps) -> None:
    """A thin line around the nodes inside the support cap."""
    if _has_outline(maps):
        ax.contour(
            *maps.axes, maps.within.T.astype(float), levels=[0.5], colors=COLOUR["euclidean"], linewidths=0.7, zorder=1
        )


def draw_codes(ax: Axes, maps: LatentMaps) -> None:
    """Encoded demonstrations as small semi-transparent points."""
    dots: dict[str, Any] = {"s": 3.0, "linewidths": 0.0, "rasterized": True}
    ax.scatter(*maps.other_codes.T, color=COLOUR["euclidean"], alpha=0.25, zorder=1.5, **dots)
    for codes, group in zip(maps.codes, maps.groups, strict=True):
        ax.scatter(*codes.T, color=group_colour(group, maps.groups), alpha=0.5, zorder=2, **dots)


def legend_handles(maps: LatentMaps) -> list[Line2D]:
    """What the points and the thin line mean."""
    dots: dict[str, Any] = {"marker": "o", "linestyle": "", "markersize": 3, "mew": 0}
    found = [
        Line2D([], [], color=group_colour(group, maps.groups), label=name, **dots)
        for group, name in group_names(maps.groups).items()
    ]
    if len(maps.other_codes):
        found.append(Line2D([], [], color=COLOUR["euclidean"], label="antipodal copies", **dots))
    if _has_outline(maps):
        found.append(Line2D([], [], color=COLOUR["euclidean"], linewidth=0.7, label="support cap"))
    return found


@paper_style()
def figure_latent(maps: LatentMaps) -> Figure:
    """Variance measure on the left, magnification factor on the right."""
    width_mm, height_mm = panel_size_mm(maps.corners, SIDE_MM)
    figure = new_figure(2 * (width_mm + BAR_MM), height_mm + LEGEND_MM)
    left, right = figure.subplots(1, 2)
    draw_latent(left, maps, "log_std")
    draw_latent(right, maps, "log_magnification")
    right.set_ylabel("")
    figure.legend(handles=legend_handles(maps), loc="outside upper center", ncols=4)
    return figure


def save_latent_figure(maps: LatentMaps, folder: Path) -> list[str]:
    """Draw the latent plane into `folder`; returns the names of the files."""
    return save_figure(figure_latent(maps), folder, "latent", maps_data(maps))


def maps_data(maps: LatentMaps) -> dict[str, np.ndarray]:
    """The arrays behind the picture."""
    arrays = {f"axis_{number}": values for number, values in enumerate(maps.axes)}
    arrays |= {name: getattr(maps, name) for name in ("log_std", "log_magnification", "within", "other_codes")}
    arrays |= {f"codes_{number}": codes for number, codes in enumerate(maps.codes)}
    return arrays | {"groups": np.array(maps.groups, dtype=int)}


def _has_outline(maps: LatentMaps) -> bool:
    return bool(maps.within.any() and not maps.within.all())
