"""Scores as numbers and as documents."""

import json

import numpy as np
import pytest

from geomotion.scores.evaluation import Evaluation, combine
from geomotion.scores.score import Score, max_score, mean_score, share_score


def test_a_mean_keeps_its_spread_and_its_few_values():
    score = mean_score([1.0, 3.0], "mm", "two")
    assert (score.value, score.spread, score.count, score.values) == (2.0, 1.0, 2, (1.0, 3.0))
    assert mean_score(np.arange(101.0), "1").values == ()


def test_a_share_counts_flags():
    assert share_score([True, False, False, False]) == Score(0.25, "1", 4, statistic="share")


def test_what_is_not_finite_becomes_null_in_documents():
    document = max_score([1.0, np.inf, np.nan], "mm").as_dict()
    assert document["value"] is None
    assert document["spread"] is None
    assert document["values"] == [1.0, None, None]
    json.dumps(document, allow_nan=False)


def test_parts_combine_in_order_without_touching_one_another():
    first = Evaluation({"b": Score(1.0, "1")}, {"x": np.zeros(1)}, {"c": "reason"})
    whole = combine([first, Evaluation({"a": Score(2.0, "1")})])
    assert list(whole.scores) == ["b", "a"]
    assert list(first.scores) == ["b"]
    document = whole.document("heldout", "lasa/angle")
    assert (document["protocol"], document["dataset"], document["omitted"]) == (
        "heldout",
        "lasa/angle",
        {"c": "reason"},
    )
    assert document["scores"]["a"]["value"] == pytest.approx(2.0)
