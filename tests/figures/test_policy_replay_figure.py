"""The picture of a policy in closed loop."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg

from geomotion.figures.policy_replay import PolicyPicture, figure_policy_replay, save_policy_replay_figure
from geomotion.figures.replay import ReplayPicture

TIME = np.linspace(0, 6, 241)
PATH = np.stack([0.4 + 0.1 * np.sin(TIME), 0.3 * np.cos(TIME), 0.4 + 0 * TIME], axis=1)


def picture(links: int = 0) -> PolicyPicture:
    nothing = np.zeros_like(TIME)
    near = {f"link{number}": 0.05 + 0 * TIME for number in range(links)}
    replay = ReplayPicture(TIME, nothing, nothing, nothing + 0.5, TIME, near, PATH, PATH + 0.001, 1.0)
    return PolicyPicture(replay, PATH, 0.03 * np.exp(-TIME), 0.2 + nothing, ((2.0, 2.25),), (4.0,))


def test_distances_are_in_millimetres_with_the_push_and_the_change_marked():
    figure = figure_policy_replay(picture())
    FigureCanvasAgg(figure).draw()
    space, distance, speed, margin = figure.axes
    assert [ax.get_ylabel().rpartition("[")[2] for ax in (distance, speed, margin)] == ["mm]", "m/s]", "deg]"]
    np.testing.assert_allclose(distance.get_lines()[0].get_ydata().max(), 30.0)
    assert [patch.get_x() for patch in distance.patches] == [2.0]
    assert [line.get_xdata()[0] for line in speed.get_lines()[1:]] == [4.0]
    assert [text.get_text() for text in space.get_legend().get_texts()][:3] == ["undisturbed", "executed", "pushed"]


def test_clearances_are_drawn_near_obstacles_only_and_all_numbers_are_kept(tmp_path):
    assert len(figure_policy_replay(picture(links=2)).axes) == 5
    names = save_policy_replay_figure(picture(links=2), tmp_path)
    assert names == ["closed_loop.png", "closed_loop.pdf", "closed_loop.npz"]
    with np.load(tmp_path / "closed_loop.npz") as stored:
        np.testing.assert_array_equal(stored["pushes_s"], [[2.0, 2.25]])
        assert "clearance_m_link1" in stored
