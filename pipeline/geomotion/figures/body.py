"""A body as lines between its joints, over time and as a film (Fig. 6.14)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from geomotion.figures.style import COLOUR, new_figure, paper_style

Places = Float[np.ndarray, "time node 3"]  # [m]
Plane = Float[np.ndarray, "*batch 2"]

TURNED_RAD, RAISED_RAD = np.radians(55), np.radians(8)  # of the view, from behind and from level
SPACING = 0.45  # of the body's height, between snapshots
ROW_MM, WIDTH_MM = 42.0, 175.0
FILM_SIZE_PX, FILM_DPI = (640, 360), 100
DEMONSTRATED, SHADOW = COLOUR["demonstration"], "0.7"


@dataclass(frozen=True)
class BodyPicture:
    """What is drawn.

    Attributes:
        time_s: Times of all motions, shape (time,).
        demonstrated: Where the nodes of the demonstration are [m].
        led: The same of motions that the skill leads, by what is said of them.
        bones: Pairs of nodes with a line between them.
        forward: Where the body faces, a horizontal unit vector.
    """

    time_s: Float[np.ndarray, " time"]
    demonstrated: Places
    led: Mapping[str, Places]
    bones: Sequence[tuple[int, int]]
    forward: Float[np.ndarray, "3"]

    def seen(self, places: Float[np.ndarray, "*batch 3"]) -> Plane:
        """Places in the plane of the picture [m]."""
        up = np.array([0.0, 0.0, 1.0])
        side = np.cross(self.forward, up)
        right = np.sin(TURNED_RAD) * self.forward + np.cos(TURNED_RAD) * side
        away = np.cross(up, right)
        above = np.cos(RAISED_RAD) * up + np.sin(RAISED_RAD) * away
        return np.asarray(places @ np.stack([right, above], axis=1))

    def arrays(self) -> dict[str, np.ndarray]:
        """Everything that was drawn, by name."""
        led = {f"led_{number}_m": places for number, places in enumerate(self.led.values())}
        return {"time_s": self.time_s, "demonstrated_m": self.demonstrated, "bones": np.array(self.bones), **led}


def draw_body(ax: Axes, picture: BodyPicture, places: Float[np.ndarray, "node 3"], shift_m: float, colour: str) -> Axes:
    """Draw one posture, moved to the right."""
    seen = picture.seen(places) + np.array([shift_m, 0.0])
    width = 1.0 if colour == SHADOW else 1.3
    ax.add_collection(LineCollection([seen[list(bone)] for bone in picture.bones], colors=colour, linewidths=width))
    return ax


@paper_style()
def figure_body(picture: BodyPicture, snapshots: int) -> Figure:
    """One row for the demonstration, and one for each motion that the skill leads, with the demonstration in grey."""
    chosen = np.linspace(0, len(picture.time_s) - 1, snapshots).round().astype(int)
    figure = new_figure(WIDTH_MM, ROW_MM * (1 + len(picture.led)))
    axes = figure.subplots(1 + len(picture.led), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    shifts = SPACING * float(np.ptp(picture.demonstrated[..., 2])) * np.arange(snapshots)
    if picture.seen(picture.demonstrated[-1] - picture.demonstrated[0]).mean(axis=0)[0] < 0:
        shifts = -shifts  # the order of time is that of the way
    for ax, (title, led) in zip(axes, [("demonstration", None), *picture.led.items()], strict=True):
        for frame, shift in zip(chosen, shifts, strict=True):
            shadow = DEMONSTRATED if led is None else SHADOW
            draw_body(ax, picture, picture.demonstrated[frame], shift, shadow)
            if led is not None:
                draw_body(ax, picture, led[frame], shift, COLOUR["rollout"])
        ax.set_title(title, loc="left")
        _without_frame(ax)
    everything = [picture.seen(places[chosen]) for places in (picture.demonstrated, *picture.led.values())]
    moved = np.stack(everything) + np.stack([shifts, 0 * shifts], axis=1)[:, None]
    _limit(axes[0], moved.reshape(-1, 2))
    places = picture.seen(picture.demonstrated[chosen])[..., 0].mean(axis=1) + shifts
    axes[-1].set_xticks(places, [f"{picture.time_s[frame]:.1f} s" for frame in chosen])
    axes[-1].tick_params(length=0)
    return figure


@paper_style()
def film_frames(picture: BodyPicture, fps: float) -> list[UInt8[np.ndarray, "height width 3"]]:
    """The motions that the skill leads beside each other, the demonstration in grey, in real time."""
    duration_s = float(picture.time_s[-1] - picture.time_s[0])
    chosen = np.searchsorted(picture.time_s, picture.time_s[0] + np.arange(0, duration_s, 1 / fps)).tolist()
    width, height = (pixels / FILM_DPI for pixels in FILM_SIZE_PX)
    figure = Figure(figsize=(width, height), dpi=FILM_DPI, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    axes = figure.subplots(1, len(picture.led), sharex=True, sharey=True, squeeze=False)[0]
    everything = [picture.seen(places) for places in (picture.demonstrated, *picture.led.values())]
    frames = []
    for frame in chosen:
        for ax, (title, led) in zip(axes, picture.led.items(), strict=True):
            ax.clear()
            draw_body(ax, picture, picture.demonstrated[frame], 0.0, SHADOW)
            draw_body(ax, picture, led[frame], 0.0, COLOUR["rollout"])
            _without_frame(ax)
            ax.set_xticks([])
            ax.set_title(f"{title}, {picture.time_s[frame]:.1f} s", fontsize=8)
        _limit(axes[0], np.concatenate(everything).reshape(-1, 2))
        canvas.draw()  # type: ignore[no-untyped-call]
        pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        frames.append(pixels[..., :3].copy())
    return frames


def _without_frame(ax: Axes) -> None:
    ax.set(aspect="equal", yticks=[])
    ax.spines[:].set_visible(False)


def _limit(ax: Axes, points: Float[np.ndarray, "point 2"]) -> None:
    low, high = points.min(axis=0), points.max(axis=0)
    ax.set(xlim=(low[0] - 0.05, high[0] + 0.05), ylim=(low[1] - 0.02, high[1] + 0.02))
