import json
import re

import numpy as np

from geomotion.figures.latent_scene import latent_scene, save_latent_scene
from geomotion.figures.style import COLOUR
from geomotion.figures.tubes import tubes_of

from .spaces import AXIS, CENTRES, maps, obstacle

SHOWN = maps()
GEODESIC = SHOWN.codes[0] + [0, 0.05, 0]
LINE = np.linspace(GEODESIC[0], GEODESIC[-1], 5)


def traces(figure, name):
    return [trace for trace in figure.data if trace.name == name]


def corners(trace):
    return np.stack([trace.x, trace.y, trace.z], axis=1)


def test_walls_lie_where_the_tubes_are_and_take_little_room():
    (walls,) = [trace for trace in latent_scene(SHOWN).data if trace.name.startswith("walls")]
    tubes = tubes_of(SHOWN)
    assert len(walls.x) < len(tubes.wall.vertices)
    cell = AXIS[1] - AXIS[0]
    np.testing.assert_allclose(np.ptp(corners(walls), axis=0), np.ptp(tubes.wall.vertices, axis=0), atol=2 * cell)
    assert walls.opacity < 0.5


def test_demonstrations_of_a_group_are_one_line_with_gaps():
    for group, centre in enumerate(CENTRES):
        (line,) = traces(latent_scene(SHOWN), f"demonstrations, group {group}")
        np.testing.assert_allclose(corners(line)[:-1][:, 1], centre, rtol=1e-6)
        assert np.isnan(corners(line)[-1]).all()


def test_a_path_its_line_its_ends_and_obstacles_are_shown():
    figure = latent_scene(SHOWN, [GEODESIC], [LINE], obstacle())
    (geodesic,), (line,), (start,), (goal,), (taken,) = (
        traces(figure, name) for name in ("geodesic", "straight latent line", "start", "goal", "taken by obstacles")
    )
    np.testing.assert_array_equal(corners(geodesic), GEODESIC)
    np.testing.assert_array_equal(corners(line), LINE)
    np.testing.assert_array_equal(corners(start)[0], GEODESIC[0])
    np.testing.assert_array_equal(corners(goal)[0], GEODESIC[-1])
    assert taken.color == COLOUR["obstacle"] and np.abs(taken.x).max() < 0.6
    assert not traces(latent_scene(SHOWN), "taken by obstacles")


def test_page_is_whole_and_loads_nothing(tmp_path):
    save_latent_scene(SHOWN, tmp_path / "latent.html")
    page = (tmp_path / "latent.html").read_text(encoding="utf-8")
    assert not re.search(r"<script[^>]*\ssrc=|<link[^>]*\shref=|<iframe", page)
    assert json.dumps("demonstrations, group 1") in page
    assert 3e6 < len(page) < 5 * 2**20
