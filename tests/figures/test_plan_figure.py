from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D

from geomotion.figures.joints import LIMIT, JointAxes
from geomotion.figures.latent import LatentMaps
from geomotion.figures.plan import figure_plan, plan_data, save_plan_figure
from geomotion.figures.plan_panels import draw_component, draw_joint, draw_obstacle, draw_plan_latent, draw_positions
from geomotion.figures.plan_picture import DrawnArm, ObstacleShape, PlanPicture, in_a_row, planes_of
from geomotion.figures.style import COLOUR
from geomotion.scores.configurations import ConfigurationPath
from geomotion.scores.paths import PosePath

from .spaces import maps as tubes
from .spaces import obstacle as slab

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


def picture(dim=3, directions=False):
    axes = np.linspace(-1, 1, 20), np.linspace(-1, 1, 20)
    distance = np.hypot(*np.meshgrid(*axes, indexing="ij"))
    codes = [np.stack([SHARE, SHARE**2], axis=1)]
    maps = LatentMaps(axes, distance, distance, distance < 0.5, codes, np.empty((0, 2)), [0])
    circle = 0.05 * np.stack([np.cos(6.3 * SHARE), np.sin(6.3 * SHARE)], axis=1)
    outline = ObstacleShape("disc", circle + np.array([0.4, 0.2]), np.empty((0, 3), dtype=int), np.zeros((1, 2)))
    return PlanPicture(
        maps=maps,
        codes=codes,
        line=[np.stack([SHARE, SHARE], axis=1)],
        closed=distance < 0.2,
        demonstrations=[path(0.1 * number, dim, directions) for number in (1, 2, 3)],
        held_out=[2],
        groups=[0, 0, 0],
        paths=[path(0.25, dim, directions)],
        line_paths=[path(0.0, dim, directions)],
        obstacles=[tetrahedron(np.zeros((1, 3))) if dim == 3 else outline],
    )


def configurations(elbow, lift=0.0):
    """A planar arm of two links of 0.3 m that reaches out while it unbends, at height zero or rising."""
    joints = np.stack([-elbow / 2 + 0.3 * SHARE, elbow * (1 - 0.5 * SHARE)], axis=1)

    def tip(joints_rad):
        shoulder, both = joints_rad[:, 0], joints_rad.sum(axis=1)
        place = 0.3 * np.stack([np.cos(shoulder) + np.cos(both), np.sin(shoulder) + np.sin(both)], axis=1)
        turned = np.stack([np.cos(both / 2), 0 * both, 0 * both, np.sin(both / 2)], axis=1)
        return np.column_stack([place, lift * np.arange(len(joints_rad))]), turned

    return ConfigurationPath(joints, tip)


def arm_picture(lift=0.0, in_space=True):
    """Elbow up and elbow down; the geodesic is elbow up."""
    up, down, between = (configurations(elbow, lift) for elbow in (1.5, -1.5, 1.2))
    joints = JointAxes(("shoulder", "elbow"), np.array([-9.0, -2.0]), np.array([9.0, 2.0]))
    poses = np.array([[[0, 0, 0], [0.2, 0.2, 0], [0.4, 0.1, 0]], [[0, 0, 0], [0.3, 0.0, 0], [0.5, 0.1, 0.0]]])
    changes = (
        {"maps": tubes(), "closed": slab(), "codes": tubes().codes[:1], "line": tubes().codes[:1]} if in_space else {}
    )
    return replace(
        picture(),
        demonstrations=[up, down, up],
        groups=[0, 1, 0],
        paths=[between],
        line_paths=[between],
        obstacles=[],
        arm=DrawnArm(joints, [poses], {0: poses, 1: -poses}),
        **changes,
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


def test_joints_stand_in_the_place_of_quaternions_with_near_limits():
    shown = arm_picture()
    ax = draw_joint(Figure().add_subplot(), shown, 1)
    (geodesic,) = coloured(ax, "riemannian")
    np.testing.assert_array_equal(geodesic.get_ydata(), shown.paths[0].joints_rad[:, 1])
    limits = [line.get_ydata()[0] for line in ax.get_lines() if line.get_linestyle() == LIMIT["linestyle"]]
    assert limits == [-2.0, 2.0] and ax.get_ylabel() == "elbow [rad]"
    labels = [one.get_ylabel() for one in panels(figure_plan(shown)) if "share" in one.get_xlabel()]
    assert labels == ["shoulder [rad]", "elbow [rad]"]


def test_an_arm_in_a_plane_has_one_projection_with_its_branches():
    shown = arm_picture()
    assert shown.planes == ((0, 1),) and planes_of([path(0.1)]) == ((0, 1), (0, 2), (1, 2))
    assert planes_of([path(0.1, dim=2)]) == ((0, 1),)
    ax = draw_positions(Figure().add_subplot(), shown, (0, 1))
    links = [line for line in ax.get_lines() if len(line.get_xdata()) == 3]
    assert len(links) == 6 and len({line.get_color() for line in links}) == 3
    assert [text.get_text() for text in figure_plan(shown).legends[0].texts].count("arm along the path") == 1


@pytest.mark.parametrize("obstacles", [[], [tetrahedron(np.zeros((1, 3)))]], ids=["free", "obstacle"])
def test_an_arm_in_space_is_projected_only_among_obstacles(obstacles):
    shown = replace(arm_picture(lift=0.01), obstacles=obstacles)
    assert len(shown.planes) == 3
    ax = draw_positions(Figure().add_subplot(), shown, (0, 1))
    assert len([line for line in ax.get_lines() if len(line.get_xdata()) == 3]) == 2 * len(obstacles)


def test_a_latent_space_is_drawn_as_tubes_with_the_path_in_them():
    shown = arm_picture()
    (ax,) = [one for one in figure_plan(shown).axes if isinstance(one, Axes3D)]
    (geodesic,) = [
        line for line in ax.get_lines() if line.get_color() == COLOUR["riemannian"] and len(line.get_xdata()) > 1
    ]
    np.testing.assert_array_equal(np.stack(geodesic.get_data_3d(), axis=1), shown.codes[0])
    labels = [text.get_text() for text in figure_plan(shown).legends[0].texts]
    assert "taken by obstacles" in labels and any(text.startswith("walls") for text in labels)


def test_picture_is_saved_with_its_numbers(tmp_path):
    shown = picture()
    assert save_plan_figure(shown, tmp_path) == ["plan.png", "plan.pdf", "plan.npz"]
    with np.load(tmp_path / "plan.npz") as behind:
        np.testing.assert_array_equal(behind["leg_0_position_m"], shown.paths[0].position_m)
        np.testing.assert_array_equal(behind["leg_0_codes"], shown.codes[0])
        np.testing.assert_array_equal(behind["demo_2_orientation"], shown.demonstrations[2].orientation)
        np.testing.assert_array_equal(behind["obstacle_0_faces"], shown.obstacles[0].faces)
    np.testing.assert_array_equal(
        plan_data(arm_picture())["demo_1_joints_rad"], arm_picture().demonstrations[1].joints_rad
    )
