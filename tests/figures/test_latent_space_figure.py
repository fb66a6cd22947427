from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from geomotion.figures.latent import group_colour
from geomotion.figures.latent_space import (
    LEAST_ASPECT,
    draw_latent_space,
    figure_latent_space,
    save_latent_space_figure,
)
from geomotion.figures.style import COLOUR
from geomotion.figures.tubes import tubes_of, wall_level

from .spaces import maps, obstacle

SHOWN = maps()


def panel(**options):
    ax = Figure().add_subplot(projection="3d")
    draw_latent_space(ax, SHOWN, tubes_of(SHOWN), **options)
    FigureCanvasAgg(ax.figure).draw()
    return ax


def surface(ax):
    (found,) = [one for one in ax.collections if isinstance(one, Poly3DCollection)]
    return found


def hues(ax):
    """Colours of faces, brightness aside."""
    colours = surface(ax).get_facecolor()[:, :3]
    return np.unique((colours / colours.max(axis=1, keepdims=True)).round(3), axis=0)


def test_demonstrations_are_drawn_in_the_colour_of_their_group():
    ax = panel()
    for line, codes, group in zip(ax.get_lines(), SHOWN.codes, SHOWN.groups, strict=True):
        np.testing.assert_array_equal(np.stack(line.get_data_3d(), axis=1), codes)
        assert line.get_color() == group_colour(group, SHOWN.groups)


@pytest.mark.parametrize("view", [(25.0, -60.0), (25.0, 120.0)])
def test_only_the_walls_behind_the_insides_are_drawn(view):
    tubes = tubes_of(SHOWN)
    drawn = len(surface(panel(view=view)).get_facecolor())
    assert 0.4 < drawn / len(tubes.wall.faces) < 0.6
    elevation, azimuth = np.radians(view)
    away = -np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    assert drawn == (tubes.wall.normals @ away > 0).sum()


def test_walls_are_grey_and_obstacles_have_their_colour():
    np.testing.assert_allclose(hues(panel()), np.ones((1, 3)))
    red = np.array(to_rgb(COLOUR["obstacle"]))
    with_obstacle = hues(panel(closed=obstacle()))
    assert len(with_obstacle) == 2 and np.abs(with_obstacle - red / red.max()).sum(axis=1).min() < 2e-3


def test_axes_are_named_and_a_unit_is_as_long_on_each():
    ax = panel()
    assert [axis.get_label_text() for axis in (ax.xaxis, ax.yaxis, ax.zaxis)] == [f"$z_{n}$ [1]" for n in (1, 2, 3)]
    drawn = ax._box_aspect / np.ptp(SHOWN.corners, axis=0)
    np.testing.assert_allclose(drawn, drawn[0])


def test_an_axis_that_is_hardly_used_is_stretched_until_its_labels_are_legible():
    flat = replace(
        SHOWN, axes=(*SHOWN.axes[:2], 0.01 * SHOWN.axes[2]), codes=[one * [1, 1, 0.01] for one in SHOWN.codes]
    )
    ax = draw_latent_space(Figure().add_subplot(projection="3d"), flat, tubes_of(flat))
    assert ax._box_aspect[2] / ax._box_aspect[0] == pytest.approx(LEAST_ASPECT)


def test_both_sides_are_saved_with_the_numbers_and_the_level(tmp_path):
    figure = figure_latent_space(SHOWN)
    assert len({(ax.elev, ax.azim) for ax in figure.axes}) == 2
    labels = [text.get_text() for text in figure.legends[0].texts]
    assert labels[:2] == ["demonstrations, group 0", "demonstrations, group 1"] and labels[2].startswith("walls")
    assert save_latent_space_figure(SHOWN, tmp_path) == ["latent.png", "latent.pdf", "latent.npz"]
    with np.load(tmp_path / "latent.npz") as behind:
        assert behind["level"] == wall_level(SHOWN)
        np.testing.assert_array_equal(behind["log_magnification"], SHOWN.log_magnification)
