import numpy as np

from geomotion.robot.scenery import TEXTURES, draw_scenery, textures


def test_without_variation_every_look_is_the_same():
    looks = [draw_scenery(np.random.default_rng(seed), 0.0, 64) for seed in range(3)]
    assert looks[0] == looks[1] == looks[2]


def test_variation_is_seeded():
    one, again, other = (draw_scenery(np.random.default_rng(seed), 1.0, 64) for seed in (1, 1, 2))
    assert one == again != other


def test_textures_are_pictures():
    found = textures()
    assert len(found) == TEXTURES
    assert all(texture.dtype == np.uint8 and texture.shape == found[0].shape for texture in found)
