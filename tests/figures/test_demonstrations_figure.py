import numpy as np
import pytest

from geomotion.demos.demonstrations import UNIT_AXES, Demonstrations, Trajectory
from geomotion.figures.demonstrations import figure_data, figure_demonstrations, group_colours

TIME = np.linspace(0, 2, 20)


def demonstrations(count=3, names=("",) * 9, **widths):
    generator = np.random.default_rng(0)

    def values(name, width):
        samples = generator.standard_normal((20, width))
        return samples / np.linalg.norm(samples, axis=1, keepdims=True) if name in UNIT_AXES else samples

    return Demonstrations(
        "test",
        tuple(
            Trajectory(TIME, {name: values(name, width) for name, width in widths.items()}, names[number])
            for number in range(count)
        ),
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


def test_directions_are_drawn_on_the_sphere_beside_the_positions():
    demos = demonstrations(position_m=2, direction_xyz=3)
    figure = figure_demonstrations(demos)
    panels = [ax for ax in figure.axes if ax.axison]
    assert len(panels) == 1 + 1 + 5
    sphere = panels[1]
    assert (sphere.get_xlabel(), sphere.get_ylabel()) == ("direction x [1]", "direction y [1]")
    assert sphere.get_aspect() == 1
    curves = [line.get_xydata() for line in lines(sphere) if line.get_zorder() == 2]
    for curve, trajectory in zip(curves, demos.trajectories, strict=True):
        np.testing.assert_array_equal(curve, trajectory.channels["direction_xyz"][:, :2])


def test_groups_have_a_colour_each_and_a_line_in_the_legend():
    demos = demonstrations(6, names=("a", "b", "c") * 2, position_m=3, orientation_wxyz=4)
    figure = figure_demonstrations(demos, held_out=(5,))
    colours = group_colours(demos)
    assert list(colours) == ["a", "b", "c"]
    assert len(set(colours.values())) == 3
    for ax in figure.axes:
        if ax.axison:
            assert [line.get_color() for line in lines(ax)] == list(colours.values()) * 2
    assert [text.get_text() for text in figure.legends[0].texts] == ["a", "b", "c", "held out", "start", "end"]


@pytest.mark.parametrize("names", [("",) * 3, ("a",) * 3, ("a", "b", "c")])
def test_labels_that_name_no_groups_are_not_coloured(names):
    assert group_colours(demonstrations(3, names=names, position_m=2)) == {}


def test_channels_have_rows_of_their_own():
    figure = figure_demonstrations(demonstrations(position_m=3, orientation_wxyz=4, joints_rad=7))
    below = figure.axes[3:]
    assert [ax.get_ylabel() for ax in below if ax.axison][:7] == [
        "x [m]", "y [m]", "z [m]", "qw [1]", "qx [1]", "qy [1]", "qz [1]",
    ]  # fmt: skip
    assert [ax.axison for ax in below] == [True] * 3 + [False] + [True] * 4 + [True] * 7 + [False]
