import numpy as np
import pytest
from matplotlib.figure import Figure

from geomotion.figures.joints import LIMIT, JointAxes, label_joint, rows_of

JOINTS = JointAxes(("shoulder", "elbow"), np.array([-1.0, -np.inf]), np.array([3.0, np.inf]))


@pytest.mark.parametrize(
    ("shown", "limits"), [((0.0, 1.0), []), ((-0.9, 0.0), [-1.0]), ((0.0, 2.5), [-1.0, 3.0]), ((-2.0, 0.0), [-1.0])]
)
def test_limits_count_where_what_is_shown_comes_near_them(shown, limits):
    assert JOINTS.near(0, [np.array(shown)]) == limits
    assert JOINTS.near(1, [np.array(shown)]) == []


def test_axes_have_units_and_near_limits_a_thin_line():
    ax = Figure().add_subplot()
    label_joint(ax, JOINTS, 0, [np.array([0.0, 2.5])])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("share of the path [1]", "shoulder [rad]")
    assert [line.get_ydata()[0] for line in ax.get_lines()] == [-1.0, 3.0]
    assert {line.get_linewidth() for line in ax.get_lines()} == {LIMIT["linewidth"]}


@pytest.mark.parametrize(("count", "rows"), [(1, (1, 1)), (2, (1, 2)), (4, (1, 4)), (6, (2, 3)), (7, (2, 4))])
def test_panels_are_spread_evenly(count, rows):
    assert rows_of(count) == rows
