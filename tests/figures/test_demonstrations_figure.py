import numpy as np
import pytest

from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.figures.demonstrations import figure_data, figure_demonstrations

TIME = np.linspace(0, 2, 20)


def demonstrations(count=3, **widths):
    generator = np.random.default_rng(0)

    def values(name, width):
        samples = generator.standard_normal((20, width))
        return samples / np.linalg.norm(samples, axis=1, keepdims=True) if name == "orientation_wxyz" else samples

    return Demonstrations(
        "test",
        tuple(Trajectory(TIME, {name: values(name, width) for name, width in widths.items()}) for _ in range(count)),
        "R2",
    )


def labels(figure):
    return [(ax.get_xlabel(), ax.get_ylabel()) for ax in figure.axes if ax.axison]


def lines(ax):
    return [line for line in ax.lines if len(line.get_xdata()) > 1]


def test_planar_paths_are_drawn_once_each_with_start_and_end():
    demos = demonstrations(position_m=2, velocity_m_per_s=2)
    figure = figure_demonstrations(demos, held_out=(2,))
    (ax,) = figure.axes
    assert labels(figure) == [("x [m]", "y [m]")]
    assert [line.get_linestyle() for line in lines(ax)] == ["-", "-", ":"]
    for line, trajectory in zip(lines(ax), demos.trajectories, strict=True):
        np.testing.assert_array_equal(line.get_xydata(), trajectory.channels["position_m"])
    assert len(ax.lines) == 3 * 3
    assert ax.get_aspect() == 1
    assert [text.get_text() for text in figure.legends[0].texts] == ["demonstration", "held out", "start", "end"]


@pytest.mark.parametrize(
    ("widths", "count"),
    [
        ({"position_m": 1}, 1),
        ({"position_m": 4}, 4),
        ({"position_m": 8}, 8),
        ({"position_m": 3}, 3 + 3),
        ({"position_m": 3, "orientation_wxyz": 4}, 3 + 7),
        ({"position_m": 2, "orientation_wxyz": 4}, 1 + 6),
        ({"joints_rad": 7}, 7),
    ],
)
def test_more_dimensions_give_one_panel_each_and_projections_of_space(widths, count):
    demos = demonstrations(**widths)
    figure = figure_demonstrations(demos)
    panels = [ax for ax in figure.axes if ax.axison]
    assert len(panels) == count
    assert all(len(lines(ax)) == 3 for ax in panels)
    assert all(ylabel.endswith("]") for _, ylabel in labels(figure))


def test_the_data_behind_the_picture_are_those_of_the_demonstrations():
    demos = demonstrations(position_m=2)
    data = figure_data(demos)
    assert len(data) == 3 * 2
    np.testing.assert_array_equal(data["demo_1_position_m"], demos[1].channels["position_m"])
    np.testing.assert_array_equal(data["demo_1_time_s"], TIME)


def test_joints_are_labelled_with_number_and_unit():
    assert labels(figure_demonstrations(demonstrations(joints_rad=2))) == [
        ("time [s]", "joint 1 [rad]"),
        ("time [s]", "joint 2 [rad]"),
    ]
