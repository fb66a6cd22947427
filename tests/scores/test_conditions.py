import numpy as np

from geomotion.scores.conditions import merged
from geomotion.scores.evaluation import Evaluation
from geomotion.scores.score import Score, max_score, mean_score


def evaluation(mean: float, largest: float, demos: int, **further: Score) -> Evaluation:
    arrays = {"grid_points": np.full((3, 2), mean), "grid_shape": np.array([3, 1]), "true_eigenvalue": np.ones(3)}
    for number in range(demos):
        arrays |= {f"{name}_{number}": np.array([mean, number]) for name in ("demo", "rollout", "time", "set")}
    return Evaluation({"distance": mean_score([mean], "mm"), "rate": max_score([largest], "1/s"), **further}, arrays)


def test_means_are_averaged_and_largest_values_stay_the_largest():
    whole = merged([evaluation(1.0, 5.0, 2), evaluation(3.0, -1.0, 1, alone=mean_score([1.0], "1"))])
    assert (whole.scores["distance"].value, whole.scores["distance"].count) == (2.0, 2)
    assert whole.scores["distance"].values == (1.0, 3.0)
    assert whole.scores["rate"].value == 5.0
    assert "alone" not in whole.scores


def test_the_smallest_of_smallest_values_is_kept():
    parts = [Evaluation({"clearance": Score(value, "mm", 4, statistic="min")}) for value in (3.0, -1.0, 2.0)]
    whole = merged(parts).scores["clearance"]
    assert (whole.value, whole.statistic, whole.values) == (-1.0, "min", (3.0, -1.0, 2.0))


def test_demonstrations_and_points_of_all_conditions_are_kept():
    whole = merged([evaluation(1.0, 0.0, 2), evaluation(3.0, 0.0, 1)])
    assert [whole.arrays[f"demo_{number}"].tolist() for number in range(3)] == [[1, 0], [1, 1], [3, 0]]
    assert whole.arrays["grid_points"].shape == (6, 2)
    assert whole.arrays["grid_shape"].size == 0
    assert len(whole.arrays["true_eigenvalue"]) == 6
