"""Where the field contracts: largest eigenvalue of the symmetric part of its Jacobians."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import CenteredNorm, Normalize
from matplotlib.figure import Figure

from geomotion.figures.arrays import Array, EigenvalueGrid, EvaluationArrays
from geomotion.figures.motion import draw_demonstrations
from geomotion.figures.style import COLOUR, label_plane, new_figure, panel_size_mm, paper_style, percent

COLOURMAP = "RdBu_r"  # blue contracts, red does not
PERCENTILE = 95.0  # eigenvalues beyond it share the last colour, so that a few of them do not wash out the rest
LABEL = r"$\lambda_{\max}$ of the symmetric part [1/s]"
BINS = 40
ROUND_OFF = 1e-4  # relative difference of two ways to the same eigenvalues in single precision
TITLE_MM = 54  # what a title needs


@dataclass(frozen=True)
class Panel:
    """One Jacobian: its name and its largest eigenvalues [1/s], shape (n,)."""

    name: str
    eigenvalues: Array

    @property
    def share_not_contracting(self) -> float:
        """Share of the points where the largest eigenvalue is not negative, or not a number."""
        return float(np.mean(~(self.eigenvalues < 0)))

    @property
    def title(self) -> str:
        """Name and share."""
        return f"{self.name}\n{percent(self.share_not_contracting)} not contracting (n = {len(self.eigenvalues)})"


def panels(grid: EigenvalueGrid) -> list[Panel]:
    """The Jacobians to compare; the claimed metric is left out where it is the Euclidean one."""
    chosen = [Panel("true Jacobian, robot coordinates", grid.true)]
    if not np.allclose(grid.true, grid.claimed, rtol=0, atol=ROUND_OFF * np.nanmax(np.abs(grid.true))):
        chosen.append(Panel("true Jacobian, claimed metric", grid.claimed))
    if grid.jhat is not None:
        chosen.append(Panel(r"$\hat{J}$ of the network, Eq. (5.1)", grid.jhat))
    return chosen


def robust_norm(values: list[Array]) -> CenteredNorm:
    """Colour scale around 0 shared by several panels, cut at a percentile of the magnitudes."""
    magnitudes = np.abs(np.concatenate(values))
    magnitude = float(np.percentile(magnitudes[np.isfinite(magnitudes)], PERCENTILE))
    return CenteredNorm(0.0, magnitude or 1.0)


def on_grid(points: Array, shape: tuple[int, ...], values: Array) -> tuple[Array, Array, Array]:
    """First and second coordinate [m] and values at the points of a planar grid, each of its shape."""
    order = np.lexsort((points[:, 0], points[:, 1]))
    x, y, ordered = (column[order].reshape(shape) for column in (points[:, 0], points[:, 1], values))
    return x, y, ordered


def draw_eigenvalue_map(ax: Axes, points: Array, shape: tuple[int, ...], panel: Panel, norm: Normalize) -> Axes:
    """Draw eigenvalues on a planar grid; the area that does not contract is hatched and outlined."""
    x, y, eigenvalues = on_grid(points, shape, panel.eigenvalues)
    ax.pcolormesh(x, y, eigenvalues, norm=norm, cmap=COLOURMAP, shading="nearest", rasterized=True)
    if panel.eigenvalues.min() < 0 <= panel.eigenvalues.max():
        ax.contourf(x, y, eigenvalues, levels=[0, np.inf], colors="none", hatches=["////"])
        ax.contour(x, y, eigenvalues, levels=[0], colors="black", linewidths=1.2)
    ax.set_title(panel.title)
    label_plane(ax)
    return ax


def draw_eigenvalue_distribution(ax: Axes, panel: Panel, limit: float) -> Axes:
    """Draw a histogram of eigenvalues within ±`limit` [1/s]; those beyond it are counted in the outermost bins."""
    edges = np.linspace(-limit, limit, BINS + 1)
    counts, _ = np.histogram(np.clip(panel.eigenvalues, -limit, limit), edges)
    colours = np.where(edges[:-1] >= 0, COLOUR["expanding"], COLOUR["contracting"])
    ax.bar(edges[:-1], counts, np.diff(edges), align="edge", color=colours)
    ax.axvline(0, color="black", linewidth=0.8)
    ax.set_title(panel.title)
    ax.set(xlabel=LABEL, ylabel="points [1]")
    return ax


@paper_style()
def figure_eigenvalues(data: EvaluationArrays) -> Figure:
    """Maps for planar grids, histograms for scattered points of more dimensions.

    `data.eigenvalues` has to be present.
    """
    grid = data.eigenvalues
    assert grid is not None
    return _figure_maps(data, grid) if len(grid.shape) == 2 else _figure_distributions(grid)


def _figure_maps(data: EvaluationArrays, grid: EigenvalueGrid) -> Figure:
    shown = panels(grid)
    norm = robust_norm([panel.eigenvalues for panel in shown])
    width_mm, height_mm = panel_size_mm(grid.points, side_mm=60)
    figure = new_figure(len(shown) * max(width_mm + 6, TITLE_MM) + 28, height_mm + 22)
    axes = figure.subplots(1, len(shown), sharex=True, sharey=True, squeeze=False)[0]
    for ax, panel in zip(axes, shown, strict=True):
        draw_eigenvalue_map(ax, grid.points, grid.shape, panel, norm)
        draw_demonstrations(ax, data.judged)
        ax.label_outer()
    figure.colorbar(ScalarMappable(norm, COLOURMAP), ax=axes, label=LABEL, extend="both", shrink=0.9)
    return figure


def _figure_distributions(grid: EigenvalueGrid) -> Figure:
    shown = panels(grid)
    limit = robust_norm([panel.eigenvalues for panel in shown]).halfrange
    figure = new_figure(width_mm=150, height_mm=10 + 45 * len(shown))
    for ax, panel in zip(figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0], shown, strict=True):
        draw_eigenvalue_distribution(ax, panel, limit)
        ax.label_outer()
    return figure
