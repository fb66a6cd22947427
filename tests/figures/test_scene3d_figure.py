import json
import re
from dataclasses import replace

import numpy as np
import pytest

from geomotion.figures.joints import JointAxes
from geomotion.figures.plan_picture import DrawnArm, ObstacleShape, PlanPicture
from geomotion.figures.scene3d import save_scene, scene, triads
from geomotion.scores.paths import PosePath

from .spaces import maps

SHARE = np.linspace(0, 1, 50)
CORNERS = 0.1 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
FACES = np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])


def path(height, dim=3, directions=False):
    position = np.stack([0.3 + 0.2 * SHARE, 0.5 * SHARE, height * SHARE], axis=1)[:, :dim]
    angle = np.pi / 4 * SHARE
    orientation = [np.cos(angle), np.sin(angle), 0 * angle, *([] if directions else [0 * angle])]
    return PosePath(position, np.stack(orientation, axis=1))


def picture(dim=3, directions=False):
    way = np.linspace(np.zeros(3), [0.0, 0.4, 0.0], 9)
    return PlanPicture(
        maps=maps(),
        codes=[],
        line=[],
        closed=None,
        demonstrations=[path(0.1 * number, dim, directions) for number in (1, 2, 3)],
        held_out=[2],
        groups=[0, 0, 0],
        paths=[path(0.25, dim, directions)],
        line_paths=[path(0.0, dim, directions)],
        obstacles=[ObstacleShape("wedge", CORNERS, FACES, way)] if dim == 3 else [],
    )


def traces(figure, name):
    return [trace for trace in figure.data if trace.name == name]


def test_every_curve_is_there_with_its_points_and_one_entry_in_the_legend():
    shown = picture()
    figure = scene(shown)
    (geodesic,) = traces(figure, "geodesic")
    np.testing.assert_array_equal(np.stack([geodesic.x, geodesic.y, geodesic.z], axis=1), shown.paths[0].position_m)
    counts = {name: len(traces(figure, name)) for name in ("demonstration", "held out", "straight latent line", "goal")}
    assert counts == {"demonstration": 2, "held out": 1, "straight latent line": 1, "goal": 1}
    listed = [trace.name for trace in figure.data if trace.showlegend]
    assert len(listed) == len(set(listed))


def test_axes_are_equal_and_labelled_with_units():
    layout = scene(picture()).layout.scene
    assert layout.aspectmode == "data"
    assert [axis.title.text for axis in (layout.xaxis, layout.yaxis, layout.zaxis)] == ["x [m]", "y [m]", "z [m]"]


def test_triads_are_the_columns_of_the_rotation_at_poses_of_the_path():
    """The tool turns about its x axis from 0 to 90 degrees: y ends where z began."""
    axes = triads(path(0.0), length_m=0.05, count=5)
    ends = {name: points.reshape(5, 3, 3)[:, 1] - points.reshape(5, 3, 3)[:, 0] for name, points in axes.items()}
    np.testing.assert_allclose(ends["tool x"], np.tile([0.05, 0, 0], (5, 1)), atol=1e-12)
    np.testing.assert_allclose(ends["tool y"][0], [0, 0.05, 0], atol=1e-12)
    np.testing.assert_allclose(ends["tool y"][-1], [0, 0, 0.05], atol=1e-12)
    starts = axes["tool z"].reshape(5, 3, 3)[:, 0]
    np.testing.assert_array_equal(starts[[0, -1]], path(0.0).position_m[[0, -1]])


def test_the_arm_is_drawn_along_the_path_and_on_demand_along_demonstrations():
    poses = np.arange(18.0).reshape(2, 3, 3)
    joints = JointAxes(("one", "two"), np.full(2, -1.0), np.ones(2))
    figure = scene(replace(picture(), groups=[0, 1, 0], arm=DrawnArm(joints, [poses], {0: poses, 1: -poses})))
    (along,), (first,), (second,) = (
        traces(figure, name)
        for name in ("arm along the path", "arm, demonstrated in group 0", "arm, demonstrated in group 1")
    )
    points = np.stack([along.x, along.y, along.z], axis=1).reshape(2, 4, 3)
    np.testing.assert_array_equal(points[:, :3], poses)
    assert np.isnan(points[:, 3]).all()
    assert along.visible is None and first.visible == second.visible == "legendonly"
    assert first.line.color != second.line.color
    assert not traces(scene(picture()), "arm along the path")


def test_a_moving_obstacle_is_a_body_at_first_and_a_translucent_one_at_the_end():
    figure = scene(picture())
    (first,), (last,) = traces(figure, "wedge"), traces(figure, "wedge, at the end")
    assert first.type == last.type == "mesh3d"
    assert last.opacity < first.opacity
    np.testing.assert_array_equal(np.stack([first.i, first.j, first.k], axis=1), FACES)
    np.testing.assert_allclose(np.asarray(last.y) - np.asarray(first.y), 0.4)
    resting = replace(picture(), obstacles=[ObstacleShape("wedge", CORNERS, FACES, np.zeros((1, 3)))])
    assert [trace.name for trace in scene(resting).data if trace.type == "mesh3d"] == ["wedge"]


def test_directions_lie_on_a_sphere_beside_positions_on_the_floor():
    shown = picture(dim=2, directions=True)
    figure = scene(shown)
    flat, directed = traces(figure, "geodesic")
    assert (np.asarray(flat.z) == 0).all() and flat.scene == "scene"
    np.testing.assert_array_equal(np.stack([directed.x, directed.y, directed.z], axis=1), shown.paths[0].orientation)
    assert directed.scene == "scene2" and figure.layout.scene2.aspectmode == "data"
    (sphere,) = [trace for trace in figure.data if trace.type == "surface"]
    np.testing.assert_allclose(np.asarray(sphere.x) ** 2 + np.asarray(sphere.y) ** 2 + np.asarray(sphere.z) ** 2, 1)
    assert not traces(figure, "tool x")


def test_an_outline_in_a_plane_is_a_closed_line():
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    outline = ObstacleShape("square", square, np.empty((0, 3), dtype=int), np.zeros((1, 2)))
    (line,) = traces(scene(replace(picture(dim=2, directions=True), obstacles=[outline])), "square")
    assert line.type == "scatter3d" and len(line.x) == 5 and line.x[0] == line.x[-1]


def test_without_a_path_the_scene_shows_what_there_is():
    figure = scene(replace(picture(), paths=[], line_paths=[]))
    assert not traces(figure, "geodesic") and not traces(figure, "start")
    assert len(traces(figure, "demonstration")) == 2


@pytest.mark.parametrize("shape", [{}, {"dim": 2, "directions": True}])
def test_page_is_whole_and_loads_nothing(shape, tmp_path):
    save_scene(picture(**shape), tmp_path / "scene.html")
    page = (tmp_path / "scene.html").read_text(encoding="utf-8")
    assert [path.name for path in tmp_path.iterdir()] == ["scene.html"]
    assert len(page) > 3e6  # plotly is in it
    assert not re.search(r"<script[^>]*\ssrc=|<link[^>]*\shref=|<iframe", page)
    assert json.dumps("geodesic") in page
