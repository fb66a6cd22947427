from dataclasses import replace

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from geomotion.figures.replay import (
    ReplayPicture,
    draw_clearance,
    draw_limit_margin,
    figure_replay,
    save_replay_figure,
)
from geomotion.robot.recording import MAX_CLEARANCE_M

TIME = np.linspace(0, 6, 241)
MOMENTS = TIME[::8]


def picture(links=7):
    commanded = np.stack([0.4 + 0.1 * np.sin(TIME), 0.3 * np.cos(TIME), 0.4 + 0 * TIME], axis=1)
    return ReplayPicture(
        time_s=TIME,
        position_error_m=0.002 * np.abs(np.sin(TIME)),
        orientation_error_rad=np.radians(0.4) * np.abs(np.cos(TIME)),
        limit_margin_rad=np.radians(30 + 10 * np.cos(TIME)),
        clearance_time_s=MOMENTS,
        clearance_m={f"link{number}": 0.05 - 0.005 * number + 0 * MOMENTS for number in range(links)},
        commanded_m=commanded,
        measured_m=commanded + 0.001,
        stretch=1.25,
    )


def panels(figure):
    FigureCanvasAgg(figure).draw()
    return figure.axes


def test_errors_are_in_millimetres_and_degrees_with_the_lines_they_have_to_stay_under():
    position, orientation, *_ = panels(figure_replay(picture()))
    for ax, label, worst, limit in ((position, "[mm]", 2.0, 5.0), (orientation, "[deg]", 0.4, 1.0)):
        assert ax.get_yscale() == "log"
        curve, line = ax.get_lines()
        np.testing.assert_allclose(curve.get_ydata().max(), worst, rtol=1e-2)
        assert list(line.get_ydata()) == [limit, limit]
        assert ax.get_ylabel().endswith(label) and ax.get_ylim()[1] > limit


def test_every_panel_is_labelled_with_units_and_clearance_has_one_only_near_obstacles():
    axes = panels(figure_replay(picture()))
    assert [ax.get_ylabel().rpartition("[")[2] for ax in axes] == ["mm]", "deg]", "deg]", "m]", "mm]"]
    assert [ax.get_xlabel() for ax in axes] == ["", "", "time [s]", "time [s]", "time [s]"]
    assert len(panels(figure_replay(replace(picture(), clearance_m={})))) == 4


def test_tool_is_drawn_as_commanded_over_measured():
    shown = picture()
    lines = panels(figure_replay(shown))[3].get_lines()
    np.testing.assert_array_equal([line.get_ydata() for line in lines[::2]], shown.measured_m.T)
    np.testing.assert_array_equal([line.get_ydata() for line in lines[1::2]], shown.commanded_m.T)
    assert {line.get_linestyle() for line in lines[1::2]} == {"--"}


def test_the_links_that_come_nearest_are_named_with_their_smallest_clearance():
    ax = draw_clearance(Figure().add_subplot(), picture())
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["link6: 20 mm", "link5: 25 mm", "link4: 30 mm", "link3: 35 mm", "link2: 40 mm", "other links"]
    assert len(ax.get_lines()) == 7 + 1


def test_links_that_are_farther_than_is_measured_are_left_out():
    far = replace(picture(links=2), clearance_m={"near": 0.04 + 0 * MOMENTS, "far": MAX_CLEARANCE_M + 0 * MOMENTS})
    ax = draw_clearance(Figure().add_subplot(), far)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["near: 40 mm"]
    nowhere = replace(far, clearance_m={"far": far.clearance_m["far"]})
    assert len(panels(figure_replay(nowhere))) == 4


def test_an_error_of_zero_is_drawn_at_the_foot_of_the_axis():
    exact = replace(picture(), position_error_m=0 * TIME)
    ax = panels(figure_replay(exact))[0]
    assert np.isfinite(ax.get_lines()[0].get_ydata()).all()
    assert 0 < ax.get_ylim()[0] < ax.get_ylim()[1]


def test_a_joint_beyond_its_limit_shows_below_zero():
    ax = draw_limit_margin(Figure().add_subplot(), replace(picture(), limit_margin_rad=np.radians(TIME - 2)))
    assert ax.get_ylim()[0] < -2
    assert "-2 deg" in ax.get_title()


def test_title_says_how_far_time_was_stretched():
    assert figure_replay(picture())._suptitle.get_text().startswith("6.00 s on the robot: 1.25 times its own timing")
    assert figure_replay(replace(picture(), stretch=1.0))._suptitle.get_text() == "6.00 s on the robot"


def test_figure_is_saved_with_its_numbers(tmp_path):
    assert save_replay_figure(picture(), tmp_path) == ["replay.png", "replay.pdf", "replay.npz"]
    with np.load(tmp_path / "replay.npz") as behind:
        np.testing.assert_array_equal(behind["position_error_m"], picture().position_error_m)
        np.testing.assert_array_equal(behind["clearance_m_link3"], picture().clearance_m["link3"])
        assert float(behind["stretch"]) == 1.25
