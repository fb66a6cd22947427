"""Pictures of the scene, and films of them as GIF files.

PyBullet's software renderer is used: it needs no display and no graphics driver, and takes about 55 ms at 320×240.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from geomotion.errors import InvalidSetting
from geomotion.files import atomic
from geomotion.robot.scene import ArmScene
from geomotion.types import Float

Frame = UInt8[np.ndarray, "height width 3"]

PATH_COLOUR = (0.0, 0.45, 0.70, 1.0)  # blue, as geodesics are in all figures
FORCE_COLOUR = (0.84, 0.10, 0.10, 1.0)
FORCE_M, FORCE_DOTS, FORCE_STAYS_S = 0.2, 12, 0.8
DOT_RADIUS_M = 0.005
LONGEST_PATH = 200  # dots
COLOURS = 64
SWATCH_ROWS = 8
FROM_THE_SIDE, FROM_ABOVE = (1.25, -1.0, 0.55), (0.4, -0.6, 1.0)
ROOM = 1.15  # of the picture, around the ball that holds what is seen
LEVEL = 0.2  # height, in radii of that ball, below which a motion is level
SMALLEST_VIEW_M = 0.05


@dataclass(frozen=True)
class Light:
    """A light far away, and what comes from everywhere.

    Attributes:
        direction: Towards the light, of any length.
        ambient: Share that comes from everywhere.
        diffuse: Share that matt surfaces give back of the other.
    """

    direction: tuple[float, float, float] = (1.0, -1.0, 2.0)
    ambient: float = 0.6  # these are PyBullet's own
    diffuse: float = 0.35


@dataclass(frozen=True)
class Camera:
    """Where the scene is seen from; the default shows the Panda, a table and the space in front.

    Attributes:
        eye_m: [m].
        target_m: What is in the middle [m].
        view_deg: Vertical angle of view [deg].
        width: [pixel].
        height: [pixel].
        light: By what the scene is lit.
    """

    eye_m: tuple[float, float, float] = (1.5, -1.2, 0.85)
    target_m: tuple[float, float, float] = (0.25, -0.2, 0.3)
    view_deg: float = 36.0
    width: int = 320
    height: int = 240
    light: Light = field(default_factory=Light)

    @classmethod
    def around(cls, moved_m: Float[np.ndarray, "point 3"], resting_m: Float[np.ndarray, "other 3"]) -> "Camera":
        """One that sees all of some points [m]; from above, where those that move lie in a level plane."""
        seen_m = np.concatenate([moved_m, resting_m])
        low, high = seen_m.min(axis=0), seen_m.max(axis=0)
        radius_m = max(float(np.linalg.norm(high - low)) / 2, SMALLEST_VIEW_M)
        is_level = np.ptp(moved_m[:, 2]) < LEVEL * radius_m
        direction = np.array(FROM_ABOVE if is_level else FROM_THE_SIDE)
        middle = (low + high) / 2
        eye = middle + ROOM * radius_m / np.tan(np.radians(cls.view_deg / 2)) * direction / np.linalg.norm(direction)
        return cls(tuple(eye.tolist()), tuple(middle.tolist()))

    def picture(self, scene: ArmScene) -> Frame:
        """The scene as it is now."""
        client = scene.client
        view = client.computeViewMatrix(self.eye_m, self.target_m, [0, 0, 1])
        projection = client.computeProjectionMatrixFOV(self.view_deg, self.width / self.height, 0.05, 10)
        _, _, pixels, _, _ = client.getCameraImage(
            self.width,
            self.height,
            view,
            projection,
            lightDirection=self.light.direction,
            lightAmbientCoeff=self.light.ambient,
            lightDiffuseCoeff=self.light.diffuse,
            shadow=0,
            renderer=client.ER_TINY_RENDERER,
        )
        return np.asarray(pixels, dtype=np.uint8).reshape(self.height, self.width, 4)[:, :, :3]


@dataclass
class Film:
    """Frames taken while a motion is simulated.

    Attributes:
        fps: Frames per second of film.
        speed: Seconds of motion per second of film.
        camera: Where from.
        frames: Those taken so far.
    """

    fps: float = 12.0
    speed: float = 1.0
    camera: Camera = field(default_factory=Camera)
    frames: list[Frame] = field(default_factory=list)

    def watch(self, scene: ArmScene, time_s: float) -> None:
        """Take the next frame if it is due [s]."""
        if time_s * self.fps / self.speed >= len(self.frames) - 1e-9:
            self.frames.append(self.camera.picture(scene))

    def save(self, path: Path) -> None:
        """Write what was taken as a GIF."""
        save_gif(self.frames, path, self.fps)


@dataclass
class ForceArrow:
    """A row of dots that ends where a force acts, and stays for a while after it: pushes are short.

    Attributes:
        scene: Where it is seen.
    """

    scene: ArmScene
    _drawn: int | None = None
    _until_s: float = 0.0

    def show(self, time_s: float, tip_m: Float[np.ndarray, "3"], force_n: Float[np.ndarray, "3"]) -> None:
        """What is to be seen at a time [s], with a force [N] on the tip [m]."""
        size_n = float(np.linalg.norm(force_n))
        if self._drawn is not None and (size_n > 0 or time_s > self._until_s):
            self.scene.erase(self._drawn)
            self._drawn = None
        if size_n > 0:
            points = tip_m - FORCE_M * np.linspace(0, 1, FORCE_DOTS)[:, None] * force_n / size_n
            self._drawn, self._until_s = self.scene.draw(points, 2 * DOT_RADIUS_M, FORCE_COLOUR), time_s + FORCE_STAYS_S


def draw_path(scene: ArmScene, positions_m: Float[np.ndarray, "pose 3"]) -> None:
    """Show a path as dots, which nothing collides with, in pictures taken from now on."""
    scene.draw(_thinned(positions_m), DOT_RADIUS_M, PATH_COLOUR)


def save_gif(frames: Sequence[Frame], path: Path, fps: float) -> None:
    """Write frames as an endless GIF with one palette, whole or not at all.

    Raises:
        InvalidSetting: If there are no frames, or `fps` is not positive.
    """
    from PIL import Image

    if not frames or not fps > 0:
        raise InvalidSetting("film", f"{len(frames)} frames at {fps} frames/s", "one frame or more at a positive rate")
    seldom = np.full_like(frames[0][:1], 255 * np.array(FORCE_COLOUR[:3]))  # else it may be in none of the others
    shown = np.concatenate([*(frames[i] for i in {0, len(frames) // 2, len(frames) - 1}), *[seldom] * SWATCH_ROWS])
    palette = Image.fromarray(shown).quantize(COLOURS)
    images = [Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    with atomic(path) as temporary:
        images[0].save(temporary, save_all=True, append_images=images[1:], duration=1000 / fps, loop=0, optimize=True)


def _thinned(positions_m: Float[np.ndarray, "pose 3"]) -> Float[np.ndarray, "dot 3"]:
    count = min(len(positions_m), LONGEST_PATH)
    kept: Float[np.ndarray, "dot 3"] = positions_m[np.linspace(0, len(positions_m) - 1, count).round().astype(int)]
    return kept
