import numpy as np

from geomotion.scores.paths import PosePath
from geomotion.scores.switching import group_switches, nearest_groups


def line(height_m: float, count: int = 20) -> PosePath:
    position_m = np.column_stack([np.linspace(0, 1, count), np.full(count, height_m), np.zeros(count)])
    return PosePath(position_m, np.tile([1.0, 0, 0, 0], (count, 1)))


DEMONSTRATIONS, GROUPS = [line(0.0), line(0.1), line(1.0)], [0, 0, 1]


def test_a_path_within_one_group_never_switches():
    for height_m, group in ((0.02, 0), (0.9, 1)):
        path = line(height_m, 50)
        np.testing.assert_array_equal(nearest_groups(path, DEMONSTRATIONS, GROUPS), group)
        assert group_switches(path, DEMONSTRATIONS, GROUPS) == 0


def test_every_change_of_side_counts_once():
    share = np.linspace(0, 1, 400)
    position_m = np.column_stack([share, 0.55 + 0.4 * np.cos(3 * np.pi * share), 0 * share])
    path = PosePath(position_m, np.tile([1.0, 0, 0, 0], (400, 1)))
    assert group_switches(path, DEMONSTRATIONS, GROUPS) == 3


def test_demonstrations_of_one_group_are_one():
    assert group_switches(line(0.05), DEMONSTRATIONS[:2], [0, 0]) == 0
