"""A policy in closed loop on the simulated robot: where it was pushed, and how it came back."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from geomotion.figures.replay import ReplayPicture, draw_clearance, draw_limit_margin, near_links
from geomotion.figures.style import COLOUR, new_figure, paper_style, save_figure

PANEL_MM, CLEARANCE_MM = 48.0, 52.0
NEAR_MM = (25, 10)
ZOOM = 0.85  # of axes in space, so that their labels have room
PUSHED, CHANGED = "#B2182B", "0.35"


@dataclass(frozen=True)
class PolicyPicture:
    """What a closed loop recorded.

    Attributes:
        replay: Of the arm.
        undisturbed_m: Path of the tip without disturbances [m].
        to_path_m: Distance of the tip to it, at the times of `replay` [m].
        speed_m_per_s: Of the tip, at the same times.
        pushes_s: Beginning and end of each push.
        changes_s: When the goal changed.
    """

    replay: ReplayPicture
    undisturbed_m: Float[np.ndarray, "point 3"]
    to_path_m: Float[np.ndarray, " time"]
    speed_m_per_s: Float[np.ndarray, " time"]
    pushes_s: Sequence[tuple[float, float]]
    changes_s: Sequence[float]


def draw_paths(ax: Any, picture: PolicyPicture) -> Any:
    """Draw the path of the tip in space: undisturbed dashed, executed in colour, red where it was pushed."""
    executed, alone = picture.replay.measured_m, picture.undisturbed_m
    ax.plot(*alone.T, "--", color="black", linewidth=0.9, label="undisturbed", zorder=3)
    ax.plot(*executed.T, color=COLOUR["rollout"], linewidth=1.6, label="executed", zorder=2)
    for number, (begin_s, end_s) in enumerate(picture.pushes_s):
        first, last = np.searchsorted(picture.replay.time_s, [begin_s, end_s])
        pushed = executed[max(first - 1, 0) : last + 1]
        ax.plot(*pushed.T, color=PUSHED, linewidth=2.4, label=None if number else "pushed", zorder=4)
    ax.plot(*alone[:1].T, "o", color="black", markersize=4, label="start", zorder=5)
    ax.plot(*alone[-1:].T, "*", color="black", markersize=8, label="end, undisturbed", zorder=5)
    seen = np.concatenate([executed, alone])
    middle, reach = (seen.max(axis=0) + seen.min(axis=0)) / 2, 0.55 * np.ptp(seen, axis=0).max()
    limits = np.stack([middle - reach, middle + reach], axis=1)
    ax.set(xlim=limits[0], ylim=limits[1], zlim=limits[2])
    ax.set_box_aspect((1, 1, 1), zoom=ZOOM)
    ax.set(xlabel="$x$ [m]", ylabel="$y$ [m]", zlabel="$z$ [m]")
    ax.locator_params(nbins=4)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, 1.12), ncols=2)
    return ax


def draw_deviation(ax: Axes, picture: PolicyPicture) -> Axes:
    """Draw the distance to the undisturbed path, with the distances that pushes are judged by."""
    ax.plot(picture.replay.time_s, 1000 * picture.to_path_m, color=COLOUR["rollout"])
    for limit_mm in NEAR_MM:
        ax.axhline(limit_mm, color=COLOUR["field"], linestyle=":", linewidth=0.9, zorder=0)
    ax.set(ylabel="off the path [mm]", ylim=(0, None))
    return _marked(ax, picture)


def draw_speed(ax: Axes, picture: PolicyPicture) -> Axes:
    """Draw the speed of the tip."""
    ax.plot(picture.replay.time_s, picture.speed_m_per_s, color=COLOUR["rollout"])
    ax.set(ylabel="tip speed [m/s]", ylim=(0, None))
    return _marked(ax, picture)


@paper_style()
def figure_policy_replay(picture: PolicyPicture) -> Figure:
    """Paths in space, distance to the undisturbed path, speed and joint limits; clearances near obstacles."""
    is_near = bool(near_links(picture.replay))
    heights = [2 * PANEL_MM, CLEARANCE_MM] if is_near else [2 * PANEL_MM]
    figure = new_figure(175, sum(heights))
    above, *below = figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
    left, right = above.subfigures(1, 2, width_ratios=[1, 1.1])
    draw_paths(left.add_subplot(projection="3d"), picture)
    distance, speed, margin = right.subplots(3, 1, sharex=True)
    draw_deviation(distance, picture)
    draw_speed(speed, picture)
    draw_limit_margin(margin, picture.replay)
    margin.set_xlabel("time [s]")
    for ax in (distance, speed, margin):
        ax.margins(x=0.01)
    for part in below:
        draw_clearance(part.add_subplot(), picture.replay).margins(x=0.01)
    return figure


def save_policy_replay_figure(picture: PolicyPicture, folder: Path) -> list[str]:
    """Write the figure, and the numbers behind it."""
    replay = picture.replay
    behind = {
        "time_s": replay.time_s,
        "executed_m": replay.measured_m,
        "undisturbed_m": picture.undisturbed_m,
        "to_path_m": picture.to_path_m,
        "speed_m_per_s": picture.speed_m_per_s,
        "limit_margin_rad": replay.limit_margin_rad,
        "pushes_s": np.array(picture.pushes_s).reshape(-1, 2),
        "changes_s": np.array(picture.changes_s),
        "clearance_time_s": replay.clearance_time_s,
        **{f"clearance_m_{link}": values for link, values in replay.clearance_m.items()},
    }
    return save_figure(figure_policy_replay(picture), folder, "closed_loop", behind)


def _marked(ax: Axes, picture: PolicyPicture) -> Axes:
    for begin_s, end_s in picture.pushes_s:
        ax.axvspan(begin_s, end_s, color=PUSHED, alpha=0.25, linewidth=0.8)
    for change_s in picture.changes_s:
        ax.axvline(change_s, color=CHANGED, linestyle="-.", linewidth=0.9)
    return ax
