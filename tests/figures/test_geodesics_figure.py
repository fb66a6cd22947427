from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from geomotion.figures.geodesics import (
    JudgedGeodesic,
    draw_geodesic_joint,
    draw_geodesics,
    draw_ratios,
    figure_geodesics,
    save_geodesics_figure,
    widest_planes,
)
from geomotion.figures.joints import JointAxes
from geomotion.figures.style import COLOUR
from geomotion.scores.configurations import ConfigurationPath
from geomotion.scores.paths import PosePath

SHARE = np.linspace(0, 1, 30)


def path(height, dim=3, width=4):
    position = np.stack([0.2 * SHARE, 0.5 * SHARE, height * SHARE], axis=1)[:, :dim]
    return PosePath(position, np.tile(np.eye(width)[0], (30, 1)))


def judged(dim=3, width=4):
    paths = [path(height, dim, width) for height in (0.1, 0.12, 0.13, 0.0)]
    first = JudgedGeodesic(7, *paths, {"position": 0.6, "orientation": 0.4}, {"position": 0.5, "orientation": 0.7})
    return [first, replace(first, number=8, ratio={"position": 1.4, "orientation": 0.8})]


def of_joints():
    """A judged path of an arm of three joints."""
    turns = [ConfigurationPath(np.outer(SHARE, [1.0, -0.5, factor]), planar) for factor in (0.1, 0.2, 0.3, 0.4)]
    ratios = {"position": 0.6, "orientation": 0.4, "joint": 0.9}
    return JudgedGeodesic(7, *turns, ratios, ratios)


def planar(joints_rad):
    position = np.stack([np.cos(joints_rad[:, 0]), np.sin(joints_rad[:, 0]), 0 * joints_rad[:, 0]], axis=1)
    return position, np.tile(np.eye(4)[0], (len(joints_rad), 1))


def without_path(one):
    return replace(one, geodesic=None, line=None, ratio=dict.fromkeys(one.ratio, np.nan))


def panels(figure):
    FigureCanvasAgg(figure).draw()
    return [ax for ax in figure.axes if ax.axison]


def coloured(ax, colour):
    return [line for line in ax.get_lines() if line.get_color() == COLOUR[colour]]


def test_each_kind_of_path_has_its_look():
    one = judged()[0]
    ax = draw_geodesics(Figure().add_subplot(), [one], [path(0.2)], (1, 2))
    looks = {"field": path(0.2), "demonstration": one.demonstration, "euclidean": one.line, "rollout": one.averaged,
             "riemannian": one.geodesic}  # fmt: skip
    for colour, expected in looks.items():
        (line,) = coloured(ax, colour)
        np.testing.assert_array_equal(line.get_xydata(), expected.position_m[:, (1, 2)])
    assert all(coloured(ax, colour)[0].get_linestyle() == "--" for colour in ("euclidean", "rollout"))


@pytest.mark.parametrize("part", ["position", "orientation"])
def test_ratios_stand_beside_the_baseline_with_a_line_at_one(part):
    ax = draw_ratios(Figure().add_subplot(), judged(), part)
    one, averaged, own = ax.get_lines()
    assert list(one.get_ydata()) == [1, 1] and one.get_linestyle() == "--"
    np.testing.assert_array_equal(own.get_ydata(), [item.ratio[part] for item in judged()])
    np.testing.assert_array_equal(averaged.get_ydata(), [item.averaged_ratio[part] for item in judged()])
    assert [label.get_text() for label in ax.get_xticklabels()] == ["7", "8"]
    assert ax.get_ylim()[0] == 0 and ax.get_ylim()[1] > 1


def test_titles_state_means_over_the_geodesics_that_exist():
    one, other = judged()
    title = draw_ratios(Figure().add_subplot(), [one, without_path(other)], "position").get_title()
    assert title == "position\nmean 0.60; averaged demo 0.50"
    ax = draw_ratios(Figure().add_subplot(), [without_path(one)], "position")
    assert "no path found" in ax.get_title() and [text.get_text() for text in ax.texts] == ["no path"]


def test_views_are_those_in_which_the_motion_is_widest():
    assert widest_planes([path(0.1)]) == [(0, 1), (1, 2)]  # extents 0.2, 0.5, 0.1
    assert widest_planes([path(0.9)]) == [(1, 2), (0, 2)]
    assert widest_planes([path(0.9, dim=2)]) == [(0, 1)]


@pytest.mark.parametrize(("dim", "width", "views"), [(3, 4, 2), (2, 3, 2), (2, 4, 1)])
def test_every_view_is_labelled_with_units(dim, width, views):
    figure = figure_geodesics(judged(dim, width), [path(0.2, dim, width)])
    axes = panels(figure)
    assert len(axes) == views + 2
    assert all(ax.get_xlabel().endswith("]") and ax.get_ylabel().endswith("]") for ax in axes)
    assert all(ax.get_aspect() == 1 for ax in axes[:views])


def test_joints_are_drawn_over_the_share_of_the_path_and_have_a_ratio_of_their_own():
    joints, one = JointAxes(("a", "b", "c"), np.full(3, -3.0), np.full(3, 3.0)), of_joints()
    ax = draw_geodesic_joint(Figure().add_subplot(), [one], [], joints, 2)
    (geodesic,) = coloured(ax, "riemannian")
    np.testing.assert_array_equal(geodesic.get_ydata(), one.geodesic.joints_rad[:, 2])
    axes = panels(figure_geodesics([one], [one.demonstration], joints))
    assert [ax.get_ylabel() for ax in axes if "share" in ax.get_xlabel()] == ["a [rad]", "b [rad]", "c [rad]"]
    assert [ax.get_title().split("\n")[0] for ax in axes if "DTWD" in ax.get_ylabel()] == [*one.ratio]
    assert [ax.get_xlabel() for ax in axes].count("$x$ [m]") == 1  # an arm in a plane: one view


def test_figure_without_any_path_is_saved_with_its_numbers(tmp_path):
    found = [without_path(one) for one in judged()]
    labels = [text.get_text() for text in figure_geodesics(found, []).legends[0].texts]
    assert "straight latent line" not in labels and "training demonstration" not in labels
    assert save_geodesics_figure(found, [], tmp_path) == ["geodesics.png", "geodesics.pdf", "geodesics.npz"]
    save_geodesics_figure(judged(), [path(0.2)], tmp_path)
    with np.load(tmp_path / "geodesics.npz") as behind:
        np.testing.assert_array_equal(behind["position_ratios"], [[0.6, 0.5], [1.4, 0.5]])
        np.testing.assert_array_equal(behind["geodesic_8_position_m"], judged()[1].geodesic.position_m)
