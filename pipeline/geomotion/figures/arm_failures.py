"""Where in the latent plane the arm touches an obstacle that blocks no demonstration of the hand (Fig. 4.4)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from geomotion.figures.latent import LatentMaps, draw_codes, draw_support_cap, label_latent, legend_handles
from geomotion.figures.style import new_figure, panel_size_mm, paper_style, save_figure

COLOURMAP = "OrRd"
SIDE_MM, BAR_MM, LEGEND_MM = 80.0, 22.0, 12.0
BAR_PLACE = (1.04, 0.0, 0.045, 1.0)


@dataclass(frozen=True)
class FailureMap:
    """Shares on a latent grid.

    Attributes:
        axes: Grid coordinates along both latent axes [-].
        share: Of random joint positions that touch the obstacle; not a number where none was judged.
        solutions: Joint positions of each pose.
    """

    axes: tuple[Float[np.ndarray, " i"], Float[np.ndarray, " j"]]
    share: Float[np.ndarray, "i j"]
    solutions: int


@paper_style()
def draw_failures(ax: Axes, failures: FailureMap, maps: LatentMaps) -> Axes:
    """Draw the shares with the encoded demonstrations and the support cap on them.

    Args:
        ax: Where to draw.
        failures: The shares.
        maps: The latent plane.
    """
    image = ax.pcolormesh(
        *failures.axes, failures.share.T, cmap=COLOURMAP, vmin=0, vmax=1, shading="nearest", rasterized=True
    )
    label = f"share of {failures.solutions} joint solutions [1]"
    ax.figure.colorbar(image, cax=ax.inset_axes(BAR_PLACE), label=label)
    draw_support_cap(ax, maps)
    draw_codes(ax, maps)
    label_latent(ax)
    ax.set(title="arm touches the obstacle")
    return ax


@paper_style()
def figure_failures(failures: FailureMap, maps: LatentMaps) -> Figure:
    """The latent plane; white where no pose was judged."""
    width_mm, height_mm = panel_size_mm(maps.corners, SIDE_MM)
    figure = new_figure(width_mm + BAR_MM, height_mm + LEGEND_MM)
    draw_failures(figure.add_subplot(), failures, maps)
    figure.legend(handles=legend_handles(maps), loc="outside upper center", ncols=2)
    return figure


def save_failures_figure(failures: FailureMap, maps: LatentMaps, folder: Path) -> list[str]:
    """Draw into `folder`; returns the names of the files."""
    data = {"axis_0": failures.axes[0], "axis_1": failures.axes[1], "share": failures.share}
    data |= {f"codes_{number}": codes for number, codes in enumerate(maps.codes)}
    return save_figure(figure_failures(failures, maps), folder, "arm_failures", data)
