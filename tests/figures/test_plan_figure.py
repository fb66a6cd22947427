from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from geomotion.figures.latent import LatentMaps
from geomotion.figures.plan import (
    ObstacleShape,
    PlanPicture,
    draw_component,
    draw_obstacle,
    draw_plan_latent,
    draw_positions,
    figure_plan,
    in_a_row,
    save_plan_figure,
)
from geomotion.figures.style import COLOUR
from geomotion.scores.paths import PosePath

SHARE = np.linspace(0, 1, 50)


def path(height, dim=3, directions=False, begin=0.0, end=1.0):
    """An arc while the tool turns by a quarter."""
    share = begin + (end - begin) * SHARE
    position = np.stack([0.3 + 0.2 * share, 0.5 * share, height * np.sin(np.pi * share)], axis=1)[:, :dim]
    angle = np.pi / 4 * share
    orientation = [np.cos(angle), np.sin(angle), 0 * angle, *([] if directions else [0 * angle])]
    return PosePath(position, np.stack(orientation, axis=1))


def tetrahedron(way):
    corners = 0.05 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]) + [0.4, 0.2, 0.1]
    faces = np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])
    return ObstacleShape("wedge", corners, faces, np.asarray(way, dtype=float))


def picture(dim=3, directions=False, with_maps=True):
    axes = np.linspace(-1, 1, 20), np.linspace(-1, 1, 20)
    distance = np.hypot(*np.meshgrid(*axes, indexing="ij"))
    codes = [np.stack([SHARE, SHARE**2], axis=1)]
    maps = LatentMaps(axes, distance, distance, distance < 0.5, codes, np.empty((0, 2)), [0])
    circle = 0.05 * np.stack([np.cos(6.3 * SHARE), np.sin(6.3 * SHARE)], axis=1)
    outline = ObstacleShape("disc", circle + np.array([0.4, 0.2]), np.empty((0, 3), dtype=int), np.zeros((1, 2)))
    return PlanPicture(
        maps=maps if with_maps else None,
        codes=codes,
        line=[np.stack([SHARE, SHARE], axis=1)],
        closed=distance < 0.2 if with_maps else None,
        demonstrations=[path(0.1 * number, dim, directions) for number in (1, 2, 3)],
        held_out=[2],
        groups=[0, 0, 0],
        paths=[path(0.25, dim, directions)],
        line_paths=[path(0.0, dim, directions)],
        obstacles=[tetrahedron(np.zeros((1, 3))) if dim == 3 else outline],
    )


def panels(figure):
    FigureCanvasAgg(figure).draw()
    return [ax for ax in figure.axes if ax.axison]


def coloured(ax, colour):
    return [line for line in ax.get_lines() if line.get_color() == COLOUR[colour] and len(line.get_xdata()) > 1]


@pytest.mark.parametrize(
    ("shape", "count"),
    [
        ({}, 1 + 3 + 4),
        ({"with_maps": False}, 3 + 4),
        ({"dim": 2, "directions": True}, 1 + 1 + 1 + 3),
        ({"dim": 3, "directions": True}, 1 + 3 + 1 + 3),
    ],
)
def test_every_view_is_labelled_with_units_and_equal_where_it_shows_space(shape, count):
    axes = panels(figure_plan(picture(**shape)))
    assert len(axes) == count
    for ax in axes:
        assert ax.get_xlabel().endswith("]") and ax.get_ylabel().endswith("]")
        is_space = "share" not in ax.get_xlabel()
        assert (ax.get_aspect() == 1) == is_space


@pytest.mark.parametrize("plane", [(0, 1), (0, 2), (1, 2)])
def test_positions_are_projected_with_each_kind_in_its_look(plane):
    shown = picture()
    ax = draw_positions(Figure().add_subplot(), shown, plane)
    (geodesic,), (line,) = coloured(ax, "riemannian"), coloured(ax, "euclidean")
    np.testing.assert_array_equal(geodesic.get_xydata(), shown.paths[0].position_m[:, plane])
    np.testing.assert_array_equal(line.get_xydata(), shown.line_paths[0].position_m[:, plane])
    assert line.get_linestyle() == "--"
    assert [one.get_linestyle() for one in coloured(ax, "demonstration")] == ["-", "-", ":"]
    assert (ax.get_xlabel()[1], ax.get_ylabel()[1]) == tuple("xyz"[axis] for axis in plane)


def test_latent_panel_shows_geodesic_line_and_nodes_taken_by_obstacles():
    shown = picture()
    ax = draw_plan_latent(Figure().add_subplot(), shown)
    np.testing.assert_array_equal(coloured(ax, "riemannian")[0].get_xydata(), shown.codes[0])
    np.testing.assert_array_equal(coloured(ax, "euclidean")[0].get_xydata(), shown.line[0])
    hatched = [one for one in ax.collections if getattr(one, "hatches", None) == ["/////"]]
    reach = np.concatenate([path.vertices for path in hatched[0].get_paths()])
    assert 0.1 < np.abs(reach).max() < 0.3
    free = draw_plan_latent(Figure().add_subplot(), replace(shown, closed=np.zeros((20, 20), dtype=bool)))
    assert not [one for one in free.collections if getattr(one, "hatches", None) == ["/////"]]


def test_a_flip_of_the_quaternions_sign_stays_visible_and_demonstrations_are_turned_to_the_start():
    shown = picture()
    flipped = np.where(SHARE[:, None] < 0.5, 1, -1) * -shown.paths[0].orientation
    shown = replace(shown, paths=[PosePath(shown.paths[0].position_m, flipped)])
    ax = draw_component(Figure().add_subplot(), shown, 0)
    np.testing.assert_array_equal(coloured(ax, "riemannian")[0].get_ydata(), flipped[:, 0])
    for line, demonstration in zip(coloured(ax, "demonstration"), shown.demonstrations, strict=True):
        np.testing.assert_array_equal(line.get_ydata(), -demonstration.orientation[:, 0])


def test_legs_that_meet_share_the_axis_and_others_have_it_for_themselves():
    halves = [path(0.25, end=0.5), path(0.25, begin=0.5), path(0.1)]
    shown = replace(picture(), paths=halves, line_paths=halves, codes=[one.position_m[:, :2] for one in halves])
    spans = [
        np.ptp(line.get_xdata()) for line in coloured(draw_component(Figure().add_subplot(), shown, 0), "riemannian")
    ]
    np.testing.assert_allclose(spans, [0.5, 0.5, 1.0])
    assert in_a_row([one.position_m for one in halves]) == [[0, 1], [2]]
    marks = [line.get_marker() for line in draw_positions(Figure().add_subplot(), shown, (0, 1)).get_lines()]
    assert [marks.count(mark) for mark in "oD*"] == [2, 1, 2]


def test_an_obstacle_casts_the_shadow_of_its_faces_and_a_moving_one_also_that_of_its_end():
    resting = draw_obstacle(Figure().add_subplot(), tetrahedron(np.zeros((1, 3))), (0, 2))
    (shadow,) = [one for one in resting.collections if isinstance(one, PolyCollection)]
    assert len(shadow.get_paths()) == 4 and not resting.get_lines()
    way = np.linspace([0, 0, 0], [0.3, 0, 0], 5)
    moving = draw_obstacle(Figure().add_subplot(), tetrahedron(way), (0, 2))
    last, first = ([path.vertices for path in one.get_paths()] for one in moving.collections)
    np.testing.assert_allclose(
        np.concatenate(last) - np.concatenate(first), np.broadcast_to([0.3, 0], (16, 2)), atol=1e-12
    )
    np.testing.assert_allclose(np.ptp(moving.get_lines()[0].get_xdata()), 0.3)


def test_without_a_path_demonstrations_and_obstacles_are_still_shown(tmp_path):
    nothing = replace(picture(), codes=[], line=[], paths=[], line_paths=[])
    figure = figure_plan(nothing)
    labels = [text.get_text() for text in figure.legends[0].texts]
    assert "geodesic" not in labels and {"demonstration", "held out", "obstacle"} <= set(labels)
    assert all(len(coloured(ax, "demonstration")) == 3 for ax in panels(figure)[1:])
    assert "plan.png" in save_plan_figure(nothing, tmp_path)


def test_picture_is_saved_with_its_numbers(tmp_path):
    shown = picture()
    assert save_plan_figure(shown, tmp_path) == ["plan.png", "plan.pdf", "plan.npz"]
    with np.load(tmp_path / "plan.npz") as behind:
        np.testing.assert_array_equal(behind["leg_0_position_m"], shown.paths[0].position_m)
        np.testing.assert_array_equal(behind["leg_0_codes"], shown.codes[0])
        np.testing.assert_array_equal(behind["demo_2_orientation"], shown.demonstrations[2].orientation)
        np.testing.assert_array_equal(behind["obstacle_0_faces"], shown.obstacles[0].faces)
