"""How a scene looks from one time to the next: light, colours, textures and the camera's pose, all seeded."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8

from geomotion.robot.film import Camera, Light
from geomotion.types import Float

Colour = tuple[float, float, float]
Texture = UInt8[np.ndarray, "height width 3"]

EYE_M, TARGET_M, VIEW_DEG = (1.0, 0.08, 0.62), (0.47, 0.03, 0.0), 40.0
EYE_STD_M, TARGET_STD_M = 0.006, 0.003
LIGHT, LIGHT_STD = (1.0, -1.0, 2.0), 0.4
AMBIENT, AMBIENT_SPREAD, DIFFUSE = 0.6, 0.08, 0.35
OBJECT_COLOUR, OBJECT_STD = (0.86, 0.33, 0.28), 0.05
TABLE_COLOUR, TABLE_STD, TABLE_TINT_STD = (0.80, 0.74, 0.66), 0.03, 0.01
TEXTURE_PX, TEXTURES, STRIPES, DARK = 64, 8, 8, 175


@dataclass(frozen=True)
class Scenery:
    """One look of a scene.

    Attributes:
        camera: Where it is seen from, and by which light.
        object_colour: Red, green and blue of the object, from 0 to 1.
        table_colour: The same of the table.
        texture: Which of :func:`textures` the object has.
    """

    camera: Camera
    object_colour: Colour
    table_colour: Colour
    texture: int


def draw_scenery(generator: np.random.Generator, amount: float, picture_px: int) -> Scenery:
    """A random look; with an amount of 0 always the same but for the texture, which then is the plain one."""

    def near(middle: tuple[float, ...], std: float) -> Float[np.ndarray, "3"]:
        return np.array(middle) + amount * std * generator.standard_normal(3)

    eye, target, direction = near(EYE_M, EYE_STD_M), near(TARGET_M, TARGET_STD_M), near(LIGHT, LIGHT_STD)
    ambient = AMBIENT + amount * AMBIENT_SPREAD * generator.uniform(-1, 1)
    camera = Camera(
        _triple(eye), _triple(target), VIEW_DEG, picture_px, picture_px, Light(_triple(direction), ambient, DIFFUSE)
    )
    brightness = amount * TABLE_STD * generator.standard_normal()
    table = np.clip(near(TABLE_COLOUR, TABLE_TINT_STD) + brightness, 0, 1)
    worn = np.clip(near(OBJECT_COLOUR, OBJECT_STD), 0, 1)
    texture = int(generator.integers(TEXTURES))
    return Scenery(camera, _triple(worn), _triple(table), texture if amount > 0 else 0)


def textures() -> list[Texture]:
    """Plain, striped one way or the other, and woven, each twice: of other width or grain."""
    found = []
    generator = np.random.default_rng(0)
    for wide in (1, 2):
        dark = (np.arange(TEXTURE_PX) // (STRIPES * wide)) % 2 == 1
        stripes = np.where(dark, DARK, 235)
        grain = generator.integers(DARK, 255, (TEXTURE_PX // (4 * wide),) * 2).repeat(4 * wide, 0).repeat(4 * wide, 1)
        flat = np.full((TEXTURE_PX, TEXTURE_PX), 235 if wide == 1 else 215)
        across = np.tile(stripes, (TEXTURE_PX, 1))
        found += [flat, across, across.T, grain]
    return [np.stack([one] * 3, axis=-1).astype(np.uint8) for one in found]


def _triple(values: Float[np.ndarray, "3"]) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
