"""A motion on the simulated robot: how well it was followed, and how near it came to limits and obstacles."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from geomotion.figures.style import COLOUR, SEQUENCE, new_figure, paper_style, save_figure
from geomotion.robot.recording import MAX_CLEARANCE_M

POSITION_LIMIT_MM, ORIENTATION_LIMIT_DEG = 5.0, 1.0
DECADES = 4  # below its limit, an error is shown
TITLE_MM, PANEL_MM, CLEARANCE_MM = 8.0, 42.0, 52.0
LIMIT: dict[str, Any] = {"color": COLOUR["obstacle"], "linestyle": "--", "linewidth": 0.9}
# of the nearest links; the others are drawn in grey
LOOKS = tuple(
    zip((SEQUENCE[number] for number in (0, 1, 2, 4, 5)), ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1))), strict=True)
)


@dataclass(frozen=True)
class ReplayPicture:
    """What a replay recorded.

    Attributes:
        time_s: Times [s].
        position_error_m: Distance between commanded and measured tool [m].
        orientation_error_rad: Angle between them [rad].
        limit_margin_rad: Of the joint that is nearest to a limit [rad].
        clearance_time_s: Times at which clearances were measured [s].
        clearance_m: Distance between each link and the nearest obstacle [m], at most what is measured; may be empty.
        commanded_m: Tool positions asked for [m].
        measured_m: Tool positions reached [m].
        stretch: How many times longer the motion takes than its own timing, to keep the joints' limits.
    """

    time_s: Float[np.ndarray, " time"]
    position_error_m: Float[np.ndarray, " time"]
    orientation_error_rad: Float[np.ndarray, " time"]
    limit_margin_rad: Float[np.ndarray, " time"]
    clearance_time_s: Float[np.ndarray, " moment"]
    clearance_m: dict[str, Float[np.ndarray, " moment"]]
    commanded_m: Float[np.ndarray, "time 3"]
    measured_m: Float[np.ndarray, "time 3"]
    stretch: float


def draw_errors(
    ax: Axes,
    time_s: Float[np.ndarray, " time"],
    errors: Float[np.ndarray, " time"],
    limit: float,
    quantity: str,
    unit: str,
) -> Axes:
    """Draw tracking errors on a log axis, with the limit that they have to keep, in the given unit."""
    lowest = limit / 10**DECADES
    ax.semilogy(time_s, np.maximum(errors, lowest), color=COLOUR["riemannian"], linewidth=1.2)
    ax.axhline(limit, **LIMIT)
    worst = float(errors.max())
    bottom = max(lowest, 10 ** np.floor(np.log10(max(worst, lowest)) - 1))
    title = f"worst {worst:.2g} {unit}, allowed {limit:g} {unit}"
    ax.set(ylabel=f"{quantity} [{unit}]", ylim=(bottom, 2 * max(worst, limit)), title=title)
    return ax


def draw_limit_margin(ax: Axes, picture: ReplayPicture) -> Axes:
    """Draw how far the joint nearest to a limit is from it; below zero it is beyond; nothing where there are none."""
    if not np.isfinite(picture.limit_margin_rad).all():
        ax.set(ylabel="joint-limit margin [deg]", title="no limits")
        return ax
    margin_deg = np.degrees(picture.limit_margin_rad)
    ax.plot(picture.time_s, margin_deg, color=COLOUR["riemannian"], linewidth=1.2)
    ax.axhline(0, **LIMIT)
    low, high = float(margin_deg.min()), float(margin_deg.max())
    limits = (min(0.0, 1.1 * low), 1.1 * max(high, 1.0))
    ax.set(ylabel="joint-limit margin [deg]", ylim=limits, title=f"smallest {low:.3g} deg")
    return ax


def draw_tool(ax: Axes, picture: ReplayPicture) -> Axes:
    """Draw the tool's coordinates: commanded dashed in black, measured in colours."""
    for axis, name in enumerate("xyz"):
        ax.plot(picture.time_s, picture.measured_m[:, axis], color=SEQUENCE[axis], linewidth=1.6, label=f"${name}$")
        ax.plot(picture.time_s, picture.commanded_m[:, axis], "--", color="black", linewidth=0.8)
    ax.get_lines()[-1].set_label("commanded")
    ax.set(ylabel="tool position [m]")
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 0.98), ncols=4, handlelength=1.4, columnspacing=1.2)
    return ax


def draw_clearance(ax: Axes, picture: ReplayPicture) -> Axes:
    """Draw the distance between obstacles and the links that come near, the nearest ones by name; zero is contact."""
    links = near_links(picture)
    for number, link in enumerate(links):
        distance_mm = 1000 * picture.clearance_m[link]
        if number < len(LOOKS):
            label = f"{link}: {distance_mm.min():.0f} mm"
            colour, style = LOOKS[number]
            ax.plot(picture.clearance_time_s, distance_mm, color=colour, linestyle=style, label=label, zorder=3)
        else:
            ax.plot(picture.clearance_time_s, distance_mm, color=COLOUR["field"], linewidth=0.7, zorder=2)
    if len(links) > len(LOOKS):
        ax.get_lines()[-1].set_label("other links")
    ax.axhline(0, **LIMIT)
    ax.set(ylabel="clearance [mm]", xlabel="time [s]")
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), title="smallest clearance")
    return ax


def near_links(picture: ReplayPicture) -> list[str]:
    """Links that come as near to an obstacle as is measured, the nearest first."""
    nearest_m = {link: float(distance_m.min()) for link, distance_m in picture.clearance_m.items()}
    return sorted((link for link in nearest_m if nearest_m[link] < MAX_CLEARANCE_M), key=lambda link: nearest_m[link])


@paper_style()
def figure_replay(picture: ReplayPicture) -> Figure:
    """Tracking errors, joint limits and the tool over time; clearances where any link comes near an obstacle."""
    heights = [2 * PANEL_MM, CLEARANCE_MM] if near_links(picture) else [2 * PANEL_MM]
    figure = new_figure(175, TITLE_MM + sum(heights))
    above, *below = figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
    (position, orientation), (margin, tool) = above.subplots(2, 2, sharex=True)
    errors_mm, errors_deg = 1000 * picture.position_error_m, np.degrees(picture.orientation_error_rad)
    draw_errors(position, picture.time_s, errors_mm, POSITION_LIMIT_MM, "position error", "mm")
    draw_errors(orientation, picture.time_s, errors_deg, ORIENTATION_LIMIT_DEG, "orientation error", "deg")
    draw_limit_margin(margin, picture)
    draw_tool(tool, picture)
    for ax in (margin, tool):
        ax.set_xlabel("time [s]")
        ax.margins(x=0.01)
    for part in below:
        draw_clearance(part.add_subplot(), picture).margins(x=0.01)
    figure.suptitle(_timing(picture), fontsize=8)
    return figure


def save_replay_figure(picture: ReplayPicture, folder: Path) -> list[str]:
    """Draw a replay into `folder`; returns the names of the files."""
    names = [name for name in vars(picture) if name not in ("clearance_m", "stretch")]
    arrays = {name: getattr(picture, name) for name in names}
    arrays |= {f"clearance_m_{link}": distance for link, distance in picture.clearance_m.items()}
    return save_figure(figure_replay(picture), folder, "replay", arrays | {"stretch": np.array(picture.stretch)})


def _timing(picture: ReplayPicture) -> str:
    duration = f"{picture.time_s[-1] - picture.time_s[0]:.2f} s on the robot"
    if picture.stretch <= 1:
        return duration
    return f"{duration}: {picture.stretch:.2f} times its own timing, to keep the joints' limits"
