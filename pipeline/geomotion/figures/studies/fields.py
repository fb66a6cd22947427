"""Pictures of studies of planar fields (Fig. 5.2, 5.4-5.6, 5.9-5.13, 6.11, 6.12)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from geomotion.figures.arrays import Array, EvaluationArrays, Region, read_evaluation
from geomotion.figures.eigenvalues import COLOURMAP, on_grid, robust_norm
from geomotion.figures.motion import draw_demonstrations, draw_plane
from geomotion.figures.region import draw_region
from geomotion.figures.studies.panels import JudgedCell, StudyFigure, named_arrays, of_first_seed, panel_grid
from geomotion.figures.style import COLOUR, label_plane, new_figure, paper_style

CORNERS = 4
SIDE_MM = 52
MAP_MM = 42
MAP_TICKS = 3  # of each axis of a map
RATIO_COLOURMAP = "viridis"
JITTER = 0.12  # half the width over which points of one variant are spread


@dataclass(frozen=True)
class Judged:
    """A cell with what its evaluation left."""

    cell: JudgedCell
    data: EvaluationArrays

    @property
    def region(self) -> Region:
        """What rollouts from a grid did."""
        assert self.data.region is not None  # cells without are left out
        return self.data.region


def _planar(cells: Sequence[JudgedCell]) -> list[Judged]:
    judged = [Judged(cell, read_evaluation(cell.folder / "evaluation.npz")) for cell in cells]
    return [one for one in judged if one.data.dim == 2 and one.data.region is not None]


@paper_style()
def motions(cells: Sequence[JudgedCell]) -> StudyFigure | None:
    """Fields with rollouts from demonstrations' starts and from corners."""
    judged = _planar(of_first_seed(cells))
    caption = (
        "Black: demonstrations. Orange: rollouts from their starts, held-out ones dashed. Green: rollouts from corners "
        "around them. White star: goal. Grey: the field."
    )
    arrays = [
        {"starts": np.stack([item.rollout[0] for item in one.data.judged]), "ends": _ends(one.data)} for one in judged
    ]
    return _panels("Learned motion", caption, judged, arrays, partial(draw_plane, grid_rollouts=CORNERS))


@paper_style()
def regions(cells: Sequence[JudgedCell]) -> StudyFigure | None:
    """Rollouts from a grid, in and out of the region of the demonstrations."""
    judged = _planar(of_first_seed(cells))
    caption = "Rollouts from an equidistant grid: strong where they are inside the convex hull of the demonstrations."
    arrays = [{"steps_inside": _steps(one)} for one in judged]
    return _panels("Rollouts from anywhere", caption, judged, arrays, _draw_region)


@paper_style()
def steps_inside(cells: Sequence[JudgedCell]) -> StudyFigure | None:
    """Distribution of the steps that rollouts spend inside the region, all seeds together."""
    judged = _planar(cells)
    if not judged:
        return None
    judged.sort(key=lambda one: [cell.dataset for cell in cells].index(one.cell.dataset))
    by_dataset = {name: list(group) for name, group in groupby(judged, key=lambda one: one.cell.dataset)}
    widest = max(len({one.cell.variant for one in group}) for group in by_dataset.values())
    figure = new_figure(len(by_dataset) * (14 * widest + 8) + 16, 80)
    axes = figure.subplots(1, len(by_dataset), sharey=True, squeeze=False)[0]
    for ax, (dataset, group) in zip(axes, by_dataset.items(), strict=True):
        variants = list(dict.fromkeys(one.cell.variant for one in group))
        steps = [np.concatenate([_steps(one) for one in group if one.cell.variant == name]) for name in variants]
        draw_distributions(ax, variants, steps)
        ax.set_title(dataset)
    axes[0].set_ylabel("time steps inside the demonstration region [1]")
    arrays = [{"steps_inside": _steps(one)} for one in judged]
    caption = (
        "One point a rollout from an equidistant grid; boxes hold the middle half, with the median. More steps inside "
        "mean that motions come to the demonstrations sooner, or stay longer."
    )
    return StudyFigure(figure, "Time among the demonstrations", caption, named_arrays([i.cell for i in judged], arrays))


def eigenvalues_true(cells: Sequence[JudgedCell]) -> StudyFigure | None:
    """Eigenvalues of the symmetric part of the true Jacobian."""
    return _eigenvalue_maps(cells, "true", "Eigenvalues of sym ∂f/∂x, the true Jacobian")


def eigenvalues_jhat(cells: Sequence[JudgedCell]) -> StudyFigure | None:
    """Eigenvalues of the symmetric part of Ĵ."""
    return _eigenvalue_maps(cells, "jhat", "Eigenvalues of sym Ĵ of Eq. (5.1), which is not the field's Jacobian")


FIELD_STUDY_FIGURES = {
    "motions": motions,
    "regions": regions,
    "steps_inside": steps_inside,
    "eigenvalues_true": eigenvalues_true,
    "eigenvalues_jhat": eigenvalues_jhat,
}


def draw_distributions(ax: Axes, names: Sequence[str], values: Sequence[Array]) -> Axes:
    """A box and all points for each name."""
    places = list(range(1, len(names) + 1))
    ax.boxplot([*values], positions=places, widths=0.5, showfliers=False, medianprops={"color": COLOUR["rollout"]})
    for place, own in zip(places, values, strict=True):
        ax.plot(place + JITTER * np.sin(np.arange(len(own))), own, ".", color="black", markersize=1.5)
    ax.set_xticks(places, names, rotation=30, ha="right")
    return ax


@paper_style()
def _eigenvalue_maps(cells: Sequence[JudgedCell], matrix: str, title: str) -> StudyFigure | None:
    found = [(one, spectrum) for one in _planar(of_first_seed(cells)) if (spectrum := _spectrum(one.data, matrix))]
    if not found:
        return None
    quantities = {
        "smallest eigenvalue [1/s]": [smallest for _, (smallest, _) in found],
        "largest eigenvalue [1/s]": [largest for _, (_, largest) in found],
        "contraction ratio [1/s]": [largest - smallest for _, (smallest, largest) in found],
    }
    figure = new_figure(len(found) * MAP_MM + 36, len(quantities) * (MAP_MM + 4) + 16)
    grid = figure.subplots(len(quantities), len(found), squeeze=False)
    for row, (name, values) in zip(grid, quantities.items(), strict=True):
        is_ratio = name.startswith("contraction")
        norm: Normalize = Normalize(0, robust_norm(values).halfrange) if is_ratio else robust_norm(values)
        colourmap = RATIO_COLOURMAP if is_ratio else COLOURMAP
        for ax, (one, _), own in zip(row, found, values, strict=True):
            assert one.data.eigenvalues is not None
            points, shape = one.data.eigenvalues.points, one.data.eigenvalues.shape
            ax.pcolormesh(*on_grid(points, shape, own), norm=norm, cmap=colourmap, rasterized=True)
            label_plane(ax)
            ax.locator_params(nbins=MAP_TICKS)
            ax.set_title(f"{one.cell.dataset}\n{one.cell.variant}" if ax in grid[0] else "")
            ax.label_outer()
        figure.colorbar(ScalarMappable(norm, colourmap), ax=list(row), label=name, extend="both", shrink=0.9)
    arrays = [{"smallest": smallest, "largest": largest} for _, (smallest, largest) in found]
    caption = (
        "At the points of an equidistant grid around the demonstrations. Blue contracts, red does not; each row has "
        "one scale, cut at the 95th percentile. The ratio is the difference of both."
    )
    return StudyFigure(figure, title, caption, named_arrays([one.cell for one, _ in found], arrays))


def _panels(
    title: str,
    caption: str,
    judged: Sequence[Judged],
    arrays: Sequence[Mapping[str, Array]],
    draw: Callable[[Axes, EvaluationArrays], object],
) -> StudyFigure | None:
    """A panel for each cell; None where there is none."""
    if not judged:
        return None
    cells = [one.cell for one in judged]
    figure, panels = panel_grid(cells, SIDE_MM)
    for ax, one in zip(panels, judged, strict=True):
        draw(ax, one.data)
        ax.label_outer()
    return StudyFigure(figure, title, caption, named_arrays(cells, arrays))


def _draw_region(ax: Axes, data: EvaluationArrays) -> None:
    assert data.region is not None
    draw_region(ax, data.region)
    draw_demonstrations(ax, data.judged)


def _spectrum(data: EvaluationArrays, matrix: str) -> tuple[Array, Array] | None:
    grid = data.eigenvalues
    if grid is None or len(grid.shape) != 2:
        return None
    smallest, largest = (grid.true_smallest, grid.true) if matrix == "true" else (grid.jhat_smallest, grid.jhat)
    return None if smallest is None or largest is None else (smallest, largest)


def _steps(one: Judged) -> Array:
    return one.region.steps_inside.astype(np.float64)


def _ends(data: EvaluationArrays) -> Array:
    return np.stack([item.rollout[-1] for item in data.judged])
