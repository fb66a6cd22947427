"""One look for all figures: sizes in millimetres, one meaning per colour, three files per picture.

Nothing global changes on import: figures are made under ``@paper_style()`` and with ``Figure()``, without pyplot.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from geomotion.files import atomic

MM_PER_INCH = 25.4
PNG_DPI = 200
ASPECTS = (0.4, 2.5)  # narrowest and widest panel, width / height

FONTS: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "mathtext.fontset": "dejavusans",
    "pdf.fonttype": 42,  # text stays text in the PDF, as journals ask
}
LINES: dict[str, Any] = {
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 1.2,
    "hatch.linewidth": 0.4,
    "legend.frameon": False,
}
PAPER: dict[str, Any] = FONTS | LINES

# Okabe-Ito where a colour is needed: they stay apart for colour-blind readers, and line styles repeat the distinction.
COLOUR: Mapping[str, str] = MappingProxyType(
    {
        "demonstration": "black",
        "field": "0.72",
        "rollout": "#E69F00",  # from demonstration starts
        "grid": "#009E73",  # from grid or random starts
        "outside": "#9FD8C6",  # the same, where it is outside the demonstration region
        "region": "#EFEFEF",
        "obstacle": "#D55E00",
        "riemannian": "#0072B2",
        "euclidean": "0.35",
        "contracting": "#4393C3",
        "expanding": "#B2182B",
    }
)
# For quantities without a colour of their own.
SEQUENCE = ("#0072B2", "#CC79A7", "#56B4E9", "#D55E00", "#009E73", "#E69F00")


@contextmanager
def paper_style() -> Iterator[None]:
    """The look of a paper, as a context or as a decorator: ``@paper_style()``."""
    with rc_context(cast(Any, PAPER)):  # matplotlib types each key as a literal, which merged dictionaries lose
        yield


def new_figure(width_mm: float | int, height_mm: float | int) -> Figure:
    """An empty figure that is not known to pyplot."""
    return Figure(figsize=(width_mm / MM_PER_INCH, height_mm / MM_PER_INCH), layout="constrained")


def panel_size_mm(points: NDArray[np.float64], side_mm: float | int) -> tuple[float, float]:
    """Width and height of a panel with equal scales, of about the area of a square with the given side.

    Args:
        points: What it shows, shape (n, 2).
        side_mm: Side of that square [mm].
    """
    width, height = np.ptp(points, axis=0)
    stretch = float(np.sqrt(np.clip(width / height if height > 0 else np.inf, *ASPECTS)))
    return side_mm * stretch, side_mm / stretch


def state_label(axis: int) -> str:
    """Label of a coordinate with its unit."""
    return rf"$x_{{{axis + 1}}}$ [m]"


def label_plane(ax: Axes) -> None:
    """Label the axes of a plane of states, with equal scales and few enough ticks not to touch."""
    ax.set(xlabel=state_label(0), ylabel=state_label(1), aspect="equal")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MaxNLocator(nbins=5))


def limit_to(ax: Axes, points: NDArray[np.float64], margin: float = 0.08) -> None:
    """Show a box around planar points of shape (n, 2), whatever else is drawn: diverging rollouts leave it."""
    low, high = points.min(axis=0), points.max(axis=0)
    room = margin * (high - low)
    ax.set(xlim=(low[0] - room[0], high[0] + room[0]), ylim=(low[1] - room[1], high[1] + room[1]))


def percent(share: float) -> str:
    """A share as a percentage with one decimal, exact at the ends: 0 % and 100 % mean none and all."""
    if share in (0.0, 1.0):
        return f"{share:.0%}"
    return f"{min(max(share, 0.001), 0.999):.1%}"


def save_figure(figure: Figure, folder: Path, name: str, data: Mapping[str, ArrayLike]) -> list[str]:
    """Write a figure as PNG and PDF, and the numbers behind it as NPZ.

    Args:
        figure: What to save.
        folder: Where to; made if needed.
        name: File name without suffix.
        data: The arrays that were drawn.

    Returns:
        The names of the three files.

    Raises:
        DiskFull: If space ran out.
    """
    with paper_style():
        for suffix, options in ((".png", {"dpi": PNG_DPI}), (".pdf", {"metadata": {"CreationDate": None}})):
            with atomic(folder / f"{name}{suffix}") as temporary:
                figure.savefig(temporary, **options)
    with atomic(folder / f"{name}.npz") as temporary:
        np.savez_compressed(temporary, **{key: np.asarray(values) for key, values in data.items()})  # type: ignore[arg-type]
    return [f"{name}{suffix}" for suffix in (".png", ".pdf", ".npz")]
