"""Where fields are judged."""

import numpy as np

from geomotion.scores.grids import Box, bounding_box, sample_box

BOX = Box(np.array([0.0, -1.0]), np.array([2.0, 3.0]))


def test_a_box_surrounds_all_curves_and_grows_by_shares_of_its_extent():
    box = bounding_box([np.array([[0.0, 3.0], [1.0, 0.0]]), np.array([[2.0, -1.0]])])
    np.testing.assert_array_equal([box.lower, box.upper], [BOX.lower, BOX.upper])
    assert box.diagonal == np.sqrt(20)
    wide = box.enlarged(0.25)
    np.testing.assert_allclose([wide.lower, wide.upper], [[-0.5, -2.0], [2.5, 4.0]])


def test_a_flat_box_keeps_room_for_a_grid():
    flat = Box(np.zeros(2), np.array([1.0, 0.0])).enlarged(0.0)
    assert len(np.unique(sample_box(flat, 4, seed=0).points[:, 1])) == 4


def test_the_planar_grid_is_equidistant_row_by_row():
    sample = sample_box(BOX, 5, seed=0)
    assert sample.shape == (5, 5)
    x, y = sample.points.reshape(5, 5, 2).transpose(2, 0, 1)
    np.testing.assert_allclose(x, np.tile(np.linspace(0, 2, 5), (5, 1)))
    np.testing.assert_allclose(y, np.tile(np.linspace(-1, 3, 5), (5, 1)).T)


def test_other_dimensions_get_as_many_random_points_repeatably():
    cube = Box(-np.ones(3), 2 * np.ones(3))
    sample = sample_box(cube, 6, seed=4)
    assert sample.points.shape == (36, 3)
    assert sample.shape == ()
    assert (sample.points >= -1).all() and (sample.points <= 2).all()
    assert "random" in sample.note and "seed 4" in sample.note
    np.testing.assert_array_equal(sample.points, sample_box(cube, 6, seed=4).points)
    assert not np.array_equal(sample.points, sample_box(cube, 6, seed=5).points)
