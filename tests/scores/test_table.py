"""The table that people read."""

import numpy as np

from geomotion.scores.evaluation import Evaluation
from geomotion.scores.score import Score, max_score, mean_score, share_score
from geomotion.scores.table import scores_table

EVALUATION = Evaluation(
    {
        "train.dtwd_per_point": mean_score([1.0, 3.0], "mm"),
        "train.end_point_error": mean_score([np.inf, 1.0], "mm"),
        "contraction.true.rate": max_score([-0.123456, -3.0], "1/s"),
        "goal.never_reached": share_score([True, False, False, False]),
    },
    omitted={"region": "the state has 4 dimensions"},
)


def rows(evaluation: Evaluation = EVALUATION) -> list[str]:
    return scores_table(evaluation.document("heldout", "letters/j")).splitlines()


def row(name: str) -> list[str]:
    return next(line for line in rows() if line.startswith(f"  {name}")).split()


def test_every_score_has_value_spread_unit_and_count():
    assert row("dtwd_per_point") == ["dtwd_per_point", "2", "±", "1", "mm", "n=2"]
    assert row("never_reached") == ["never_reached", "0.25", "n=4"]


def test_what_is_not_a_mean_says_what_it_is():
    assert row("rate")[-1] == "max"
    assert row("rate")[1] == "-0.1235"


def test_diverged_results_are_visible():
    assert "not finite" in " ".join(row("end_point_error"))


def test_the_heading_names_data_and_protocol_and_omissions_keep_their_reason():
    assert rows()[0] == "letters/j, protocol heldout"
    assert rows()[-1] == "  region: the state has 4 dimensions"


def test_groups_are_separated_and_columns_line_up():
    counts = [line.index("n=") for line in rows() if "n=" in line]
    assert len(set(counts)) == 1
    assert rows().count("") == 4


def test_an_unknown_group_is_shown_under_its_own_name():
    assert "clearance" in rows(Evaluation({"clearance.smallest": Score(1.0, "mm")}))
