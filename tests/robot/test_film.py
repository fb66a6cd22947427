"""Pictures show what is there; films are small and whole."""

import numpy as np
import pytest
import torch
from PIL import Image

from geomotion.errors import InvalidSetting
from geomotion.obstacles.solids import Sphere
from geomotion.robot import panda
from geomotion.robot.film import Camera, draw_path, save_gif

SMALL = Camera(width=96, height=72)


def changed(before: np.ndarray, after: np.ndarray) -> int:
    return int((before != after).any(axis=2).sum())


def test_arm_obstacles_and_path_are_visible(scene):
    camera = Camera()
    empty = camera.picture(scene)
    assert empty.shape == (240, 320, 3)
    scene.set_joints(panda.HOME_RAD + 0.2)
    moved = camera.picture(scene)
    assert changed(empty, moved) > 500
    scene.add_obstacle("ball", Sphere(torch.tensor([0.5, -0.4, 0.3]).double(), 0.05))
    with_ball = camera.picture(scene)
    assert 100 < changed(moved, with_ball) < 5000
    draw_path(scene, np.linspace([0.4, -0.5, 0.2], [0.6, 0.3, 0.5], 400))
    with_path = camera.picture(scene)
    drawn = with_path[(with_path != with_ball).any(axis=2)]
    assert len(drawn) > 100
    assert (drawn[:, 2] > drawn[:, 0]).mean() > 0.9  # blue


@pytest.mark.parametrize("height_m", [0.0, 0.3])
def test_a_camera_sees_all_of_what_it_is_put_around(height_m):
    random = np.random.default_rng(0)
    moved_m, resting_m = random.uniform(-0.5, 0.5, (50, 3)) * [1, 1, height_m], random.uniform(0.2, 0.6, (5, 3))
    camera = Camera.around(moved_m, resting_m)
    eye = np.array(camera.eye_m)
    away = np.array(camera.target_m) - eye
    sight = np.concatenate([moved_m, resting_m]) - eye
    cosine = sight @ away / np.linalg.norm(sight, axis=1) / np.linalg.norm(away)
    assert np.degrees(np.arccos(cosine)).max() < camera.view_deg / 2
    steep = -away[2] / np.linalg.norm(away)
    assert (steep > 0.7) == (height_m == 0)  # what moves in a level plane is seen from above


def test_nothing_collides_with_a_drawn_path(scene):
    tip, _ = scene.end_effector_pose()
    draw_path(scene, np.tile(tip, (5, 1)))
    for _ in range(24):
        scene.command(panda.HOME_RAD, np.zeros(7))
        scene.step()
    np.testing.assert_allclose(scene.joints()[0], panda.HOME_RAD, atol=1e-3)


def test_a_film_of_five_seconds_is_below_two_megabytes_and_keeps_its_colours(scene, tmp_path):
    camera, frames = Camera(), []
    scene.add_obstacle("ball", Sphere(torch.tensor([0.5, -0.4, 0.3]).double(), 0.05))
    for angle in np.linspace(0, 1, 12):
        scene.set_joints(panda.HOME_RAD + 0.4 * angle)
        frames.append(camera.picture(scene))
    path = tmp_path / "film.gif"
    save_gif(5 * frames, path, 12.0)
    assert path.stat().st_size < 2e6
    with Image.open(path) as film:
        assert film.n_frames == pytest.approx(60, abs=5)  # equal neighbours may be merged
        assert sum(_durations_ms(film)) == pytest.approx(5000, rel=0.1)
        film.seek(0)
        shown = np.asarray(film.convert("RGB"), dtype=float)
    assert np.abs(shown - frames[0]).mean() < 4


def test_films_are_whole_or_absent(tmp_path):
    path = tmp_path / "film.gif"
    with pytest.raises(InvalidSetting, match="0 frames"):
        save_gif([], path, 12.0)
    with pytest.raises(ValueError):
        save_gif([np.zeros((4, 4, 3), np.uint8)], tmp_path / "film.unknown", 12.0)
    assert list(tmp_path.iterdir()) == []


def _durations_ms(film: Image.Image) -> list[float]:
    durations = []
    for index in range(film.n_frames):
        film.seek(index)
        durations.append(film.info["duration"])
    return durations
