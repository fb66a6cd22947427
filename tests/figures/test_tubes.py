"""Tubes of a latent space whose walls are known."""

from dataclasses import replace

import numpy as np
import pytest

from geomotion.figures.tubes import obstructed, tubes_of, wall_level

from .spaces import AXIS, CENTRES, RADIUS, WALL, maps, obstacle


def apart(points):
    beyond = (np.abs(points[:, 0]) - 1.0).clip(min=0)
    return np.min([np.sqrt((points[:, 1] - centre) ** 2 + points[:, 2] ** 2 + beyond**2) for centre in CENTRES], axis=0)


def test_walls_are_drawn_halfway_between_data_and_their_top():
    assert wall_level(maps()) == pytest.approx(WALL / 2, abs=0.4)


def test_the_walls_are_the_inner_ones_around_the_demonstrations():
    tubes = tubes_of(maps())
    distances = apart(tubes.wall.vertices)
    assert (distances < RADIUS).all()  # the outer sides of the same walls are left out
    assert (distances > RADIUS / 3).all()
    middle = tubes.wall.vertices[tubes.wall.faces].mean(axis=1)
    nearest = np.where(middle[:, 1] > 0, *CENTRES[::-1])
    outwards = middle - np.stack([middle[:, 0].clip(-1, 1), nearest, 0 * nearest], axis=1)
    assert (np.einsum("fd,fd->f", tubes.wall.normals, outwards) > 0).mean() > 0.99


def test_a_tube_without_a_demonstration_is_left_out():
    shown = maps()
    one = tubes_of(replace(shown, codes=shown.codes[:1], groups=[0]))
    assert (one.wall.vertices[:, 1] < 0).all() and one.inside.sum() < 0.6 * tubes_of(shown).inside.sum()


def test_obstacles_are_shown_where_they_fill_tubes():
    tubes = tubes_of(maps())
    taken = obstructed(maps(), tubes, obstacle())
    cell = AXIS[1] - AXIS[0]
    assert np.abs(taken.vertices[:, 0]).max() < 0.3 + 2 * cell
    assert apart(taken.vertices).max() < RADIUS + cell
    assert {*np.sign(taken.vertices[:, 1])} == {-1, 1}
    assert len(obstructed(maps(), tubes, np.zeros_like(tubes.inside)).faces) == 0
