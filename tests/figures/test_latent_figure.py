from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from geomotion.figures.latent import (
    GROUP_COLOURS,
    LatentMaps,
    draw_latent,
    figure_latent,
    group_colour,
    save_latent_figure,
)
from geomotion.figures.style import COLOUR

X, Y = np.linspace(-2, 2, 30), np.linspace(-1, 1, 20)


def maps(groups=(0, 0), others=5):
    """A valley along the first axis; two demonstrations in it."""
    height = np.broadcast_to(np.abs(Y), (len(X), len(Y)))
    codes = [
        np.stack([np.linspace(-1.5, 1.5, 40), np.full(40, 0.05 * number)], axis=1) for number in range(len(groups))
    ]
    return LatentMaps(
        axes=(X, Y),
        log_std=height - 2.0,
        log_magnification=8 * height + 0.1 * X[:, None],
        within=height < 0.4,
        codes=codes,
        other_codes=np.full((others, 2), -0.5),
        groups=list(groups),
    )


def panel(which="log_std", **changes):
    ax = draw_latent(Figure().add_subplot(), replace(maps(), **changes), which)
    FigureCanvasAgg(ax.figure).draw()
    return ax


def points(ax):
    """Scattered points by colour."""
    return {tuple(one.get_facecolor()[0]): one for one in ax.collections if len(one.get_offsets()) > 1}


@pytest.mark.parametrize("which", ["log_std", "log_magnification"])
def test_map_shows_each_node_where_it_is(which):
    ax = panel(which)
    mesh = ax.collections[0]
    np.testing.assert_array_equal(mesh.get_array().reshape(len(Y), len(X)), getattr(maps(), which).T)
    assert ax.get_aspect() == 1


def test_axes_and_colour_bars_have_names_and_units():
    for which, quantity in (("log_std", "data size"), ("log_magnification", "det M")):
        ax = panel(which)
        assert ax.get_xlabel() == "$z_1$ [1]" and ax.get_ylabel() == "$z_2$ [1]"
        (bar,) = ax.child_axes
        assert quantity in bar.get_ylabel() and bar.get_ylabel().endswith("[1]")


def test_colour_scale_ignores_outliers_and_what_is_not_finite():
    wild = maps().log_magnification.copy()
    wild[3, 4], wild[5, 6] = 1e6, np.nan
    mesh = panel("log_magnification", log_magnification=wild).collections[0]
    assert mesh.norm.vmin < mesh.norm.vmax < 10


def test_one_group_is_black_and_several_have_colours_that_mean_nothing_else():
    assert group_colour(3, [3, 3]) == COLOUR["demonstration"]
    colours = [group_colour(group, [2, 0, 7]) for group in (0, 2, 7)]
    assert len(set(colours)) == 3
    assert not set(GROUP_COLOURS) & {COLOUR["riemannian"], COLOUR["obstacle"]}


def test_every_demonstration_is_scattered_half_transparent_with_antipodal_copies_apart():
    shown = maps((0, 1))
    ax = draw_latent(Figure().add_subplot(), shown)
    clouds = [one for one in ax.collections if len(one.get_offsets()) > 1]
    assert [len(cloud.get_offsets()) for cloud in clouds] == [5, 40, 40]
    assert all(cloud.get_alpha() < 1 for cloud in clouds)
    np.testing.assert_array_equal(clouds[2].get_offsets(), shown.codes[1])


def test_support_cap_is_outlined_where_it_ends():
    """The cap holds |z2| < 0.4; its outline lies between the nodes on both sides of that."""
    ax = panel()
    outline = np.concatenate([path.vertices for path in ax.collections[1].get_paths()])
    inside, outside = Y[np.abs(Y) < 0.4].max(), Y[Y > 0.4].min()
    assert ((np.abs(outline[:, 1]) > inside) & (np.abs(outline[:, 1]) < outside)).all()


@pytest.mark.parametrize("value", [True, False])
def test_a_cap_without_a_border_is_neither_drawn_nor_in_the_legend(value):
    shown = replace(maps(others=0), within=np.full((30, 20), value))
    labels = [text.get_text() for text in figure_latent(shown).legends[0].texts]
    assert labels == ["encoded demonstrations"]


def test_figure_has_both_maps_and_is_saved_with_its_numbers(tmp_path):
    figure = figure_latent(maps((0, 1)))
    assert [ax.get_title() for ax in figure.axes] == ["variance measure", "magnification factor"]
    labels = [text.get_text() for text in figure.legends[0].texts]
    assert labels == ["demonstrations, group 0", "demonstrations, group 1", "antipodal copies", "support cap"]
    assert save_latent_figure(maps(), tmp_path) == ["latent.png", "latent.pdf", "latent.npz"]
    with np.load(tmp_path / "latent.npz") as behind:
        np.testing.assert_array_equal(behind["log_magnification"], maps().log_magnification)
        np.testing.assert_array_equal(behind["codes_1"], maps().codes[1])
