import math

from geomotion.stages.compare import comparison, comparison_table, objective


def document(**values) -> dict:
    scores = {name.replace("__", "."): {"value": value, "unit": "mm", "spread": 0.5} for name, value in values.items()}
    return {"dataset": "letters/j", "scores": scores}


def test_every_score_of_any_run_has_a_row_and_every_run_a_column():
    table = comparison_table(
        comparison({"a": document(train__dtw=1.0), "b": document(train__dtw=2.0, goal__missed=3.0)})
    )
    head, *rows = [line.split() for line in table.splitlines()]
    assert head == ["score", "unit", "a", "(letters/j)", "b", "(letters/j)"]
    assert rows == [["train.dtw", "mm", "1", "±", "0.5", "2", "±", "0.5"], ["goal.missed", "mm", "-", "3", "±", "0.5"]]


def test_a_score_that_is_not_finite_is_shown_as_such():
    assert "not finite" in comparison_table(comparison({"a": document(train__dtw=None), "b": document(train__dtw=1.0)}))


def test_sweeps_minimise_the_held_out_distance_where_there_is_one():
    assert objective(document(train__dtwd_per_point=1.0, heldout__dtwd_per_point=2.0)) == 2.0
    assert objective(document(train__dtwd_per_point=1.0)) == 1.0
    assert objective(document(heldout__dtwd_per_point=None)) == math.inf
    assert objective(document()) is None
