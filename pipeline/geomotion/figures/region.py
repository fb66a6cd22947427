"""How long trajectories from anywhere stay where the demonstrations are (Eq. (6.10), Fig. 5.6)."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from geomotion.figures.arrays import Array, EvaluationArrays, Mask, Region
from geomotion.figures.motion import draw_demonstrations
from geomotion.figures.style import COLOUR, label_plane, limit_to, new_figure, panel_size_mm, paper_style

HISTOGRAM_MM = 55
DRAWN_POINTS = 250  # per rollout; more are not visible and make the PDF heavy


def draw_region(ax: Axes, region: Region) -> Axes:
    """Draw the hull and every rollout: strong where it is inside, pale outside, with a dot at its start."""
    stride = max(1, region.rollouts.shape[1] // DRAWN_POINTS)
    rollouts, inside = region.rollouts[:, ::stride], region.inside[:, ::stride]
    hull = Polygon(region.hull, facecolor=COLOUR["region"], label="demonstration region", zorder=0)
    hull.set(edgecolor=COLOUR["euclidean"], linewidth=0.6)
    ax.add_patch(hull)
    outside_line = _masked_polyline(rollouts, ~inside | _after(~inside))
    ax.plot(*outside_line, color=COLOUR["outside"], linewidth=0.6, label="outside", zorder=1)
    ax.plot(*_masked_polyline(rollouts, inside), color=COLOUR["grid"], linewidth=0.8, label="inside", zorder=2)
    ax.plot(*rollouts[:, 0].T, ".", color=COLOUR["grid"], markersize=3, label="start", zorder=2)
    limit_to(ax, np.concatenate([region.hull, region.rollouts[:, 0]]))
    label_plane(ax)
    return ax


def draw_steps_inside(ax: Axes, region: Region) -> Axes:
    """Draw a histogram of the time steps that rollouts spend inside, with their mean."""
    steps, total = region.steps_inside, region.inside.shape[1]
    ax.hist(steps, bins=np.linspace(0, total, 21).tolist(), color=COLOUR["grid"], edgecolor="white", linewidth=0.5)
    mean = f"mean {steps.mean():.0f} ± {steps.std():.0f}"
    ax.axvline(steps.mean(), color="black", linestyle="--", linewidth=1, label=mean)
    ax.set(xlabel=f"time steps inside, of {total} [1]", ylabel=f"rollouts, of {len(steps)} [1]", xlim=(0, total))
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return ax


@paper_style()
def figure_region(data: EvaluationArrays) -> Figure:
    """Rollouts in and out of the demonstration region, and for how long. `data.region` has to be present."""
    assert data.region is not None
    width_mm, height_mm = panel_size_mm(data.region.rollouts[:, 0], side_mm=70)
    figure = new_figure(width_mm + HISTOGRAM_MM + 20, max(height_mm, HISTOGRAM_MM) + 20)
    left, right = figure.subplots(1, 2, width_ratios=(width_mm, HISTOGRAM_MM))
    draw_region(left, data.region)
    draw_demonstrations(left, data.judged)
    left.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    draw_steps_inside(right, data.region)
    return figure


def _after(mask: Mask) -> Mask:
    """Also the state after each marked one, so that lines of both kinds meet."""
    shifted = np.zeros_like(mask)
    shifted[:, 1:] = mask[:, :-1]
    return shifted


def _masked_polyline(rollouts: Array, mask: Mask) -> Array:
    """All rollouts as one line with gaps, shape (2, points): far faster to draw than thousands of pieces."""
    gap = np.full((len(rollouts), 1, 2), np.nan)
    visible = np.where(mask[..., None], rollouts, np.nan)
    return np.concatenate([visible, gap], axis=1).reshape(-1, 2).T
