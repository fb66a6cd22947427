import numpy as np
import pytest

from geomotion.config import ReferenceConfig, ReferenceRow, StudyColumn, StudyConfig, StudyVariant
from geomotion.errors import InvalidSetting
from geomotion.stages.initial_conditions import initial_conditions
from geomotion.stages.study_cells import Cell, compose_cells
from geomotion.stages.study_table import aligned_table, bootstrap_interval, lines, markdown_table, table_document


def study(**changes) -> StudyConfig:
    settings = {
        "title": "Table",
        "variants": [StudyVariant("plain", ["field=mlp"]), StudyVariant("ours")],
        "datasets": ["letters/j"],
        "columns": [StudyColumn("train.dtw", "DTW"), StudyColumn("contraction.jhat.rate", "rate of Ĵ")],
        "reference": ReferenceConfig("others", ["rate"], [ReferenceRow("plain", "letters/j", [-0.5])]),
        "notes": ["A note."],
    }
    return StudyConfig(**{**settings, **changes})


def scores(dtw: float | None, **others: float) -> dict:
    values = {"train.dtw": dtw, **{name.replace("__", "."): value for name, value in others.items()}}
    common = {"unit": "mm", "spread": 9.0, "statistic": "mean", "values": []}
    return {name: common | {"value": value} for name, value in values.items()}


def test_a_row_for_each_variant_with_the_numbers_of_others_beside_it():
    found = {("letters/j", "plain"): [scores(1.5, contraction__jhat__rate=-2.0)], ("letters/j", "ours"): [scores(0.5)]}
    document = table_document(study(), found, [])
    assert list(lines(document)) == [
        ["dataset", "variant", "DTW", "rate of Ĵ", "others: rate"],
        ["letters/j", "plain", "1.5", "-2", "-0.5"],
        ["", "ours", "0.5", "–", "–"],
    ]
    assert "| letters/j | plain | 1.5 | -2 | -0.5 |" in markdown_table(document)
    assert "DTW: train.dtw [mm]" in aligned_table(document)
    assert "A note." in aligned_table(document)


def test_several_seeds_are_averaged_and_their_spread_is_shown():
    found = {("letters/j", "plain"): [scores(1.0), scores(3.0)], ("letters/j", "ours"): [scores(1.0), scores(None)]}
    _, plain, ours = lines(table_document(study(seeds=[0, 1], reference=None), found, []))
    assert plain[2:] == ["2 ± 1.41 [1, 3]", "–"]
    assert ours[2:] == ["not finite", "–"]


def test_the_interval_is_that_of_a_mean_where_seeds_are_many():
    values = np.random.default_rng(3).normal(5.0, 2.0, 400)
    interval = bootstrap_interval([{"statistic": "mean", "value": value, "values": [value]} for value in values])
    expected = values.mean() + np.array([-1.96, 1.96]) * values.std() / 20
    np.testing.assert_allclose(interval, expected, atol=0.03)


def test_what_each_seed_judged_widens_the_interval_and_a_maximum_has_no_such_values():
    one = {"statistic": "mean", "value": 2.0, "values": [1.0, 3.0]}
    low, high = bootstrap_interval([one, one])
    assert low == 1 and high == 3
    assert bootstrap_interval([one | {"statistic": "max"}] * 2) == [2, 2]
    assert bootstrap_interval([one]) is None


def test_more_seeds_do_not_make_up_for_few_demonstrations():
    values = np.random.default_rng(4).normal(5.0, 2.0, 50)
    interval = bootstrap_interval([{"statistic": "mean", "value": values.mean(), "values": list(values)}] * 50)
    expected = values.mean() + np.array([-1.96, 1.96]) * values.std() / 50**0.5
    np.testing.assert_allclose(interval, expected, atol=0.1)


@pytest.mark.parametrize("moved", [0.0, 1e-6, 0.1])
def test_methods_that_start_elsewhere_are_named(tmp_path, moved):
    cells = [Cell(name, "letters/j", 0, []) for name in ("plain", "ours")]
    for number, cell in enumerate(cells):
        (tmp_path / cell.variant).mkdir()
        paths = np.stack([np.zeros((5, 2)), np.ones((5, 2)) + number * moved])
        paths[:, 1:] += number  # where motions go is their own matter
        np.savez(tmp_path / cell.variant / "evaluation.npz", region_rollouts=paths, demo_0=np.ones((4, 2)))
    starts, differing = initial_conditions([(cell, tmp_path / cell.variant) for cell in cells])
    np.testing.assert_array_equal(starts["letters/j, seed 0/region_rollouts"], [[0, 0], [1, 1]])
    np.testing.assert_array_equal(starts["letters/j, seed 0/demo_0"], [[1, 1]])
    assert [one.partition(",")[0] for one in differing] == (["ours"] if moved == 0.1 else [])


def test_references_are_left_out_where_none_applies():
    found = {("letters/c", "plain"): [scores(1.0)]}
    head, *_ = lines(table_document(study(datasets=["letters/c"]), found, []))
    assert head == ["dataset", "variant", "DTW", "rate of Ĵ"]


def test_failures_are_listed():
    table = table_document(study(), {}, ["plain, letters/j, seed 0: the reason"])
    assert "failed: plain, letters/j, seed 0: the reason" in aligned_table(table)


@pytest.mark.parametrize(
    "changes", [{"datasets": []}, {"seeds": [1, 1]}, {"jobs": 0}, {"shards": 2, "shard": 2}, {"variants": []}]
)
def test_a_study_needs_one_or_more_of_everything_once(changes):
    with pytest.raises(InvalidSetting, match=r"study\."):
        study(**changes)


@pytest.mark.parametrize("typed", ["dataset=letters/c", "seed=3", "field=linear"])
def test_what_a_study_varies_cannot_be_set_beside_it(typed):
    with pytest.raises(InvalidSetting, match=typed.split("=")[0]):
        compose_cells("ncds", study(), [typed])


def test_a_column_of_several_units_says_which_is_whose():
    joints = {name: one | {"unit": "rad"} for name, one in scores(2.0).items()}
    found = {("letters/j", "plain"): [scores(1.0)], ("arm", "plain"): [joints]}
    document = table_document(study(datasets=["letters/j", "arm"], variants=[StudyVariant("plain")]), found, [])
    assert "DTW: train.dtw [mm: letters/j; rad: arm]" in aligned_table(document)


def test_the_legend_does_not_promise_seeds_that_failed():
    found = {("letters/j", "plain"): [scores(1.0)]}
    assert "over 2 seeds [" in aligned_table(table_document(study(seeds=[0, 1]), found, []))
    failed = table_document(study(seeds=[0, 1]), found, ["ours, letters/j, seed 1: no"])
    assert "over 2 seeds, or those of them that did not fail" in aligned_table(failed)
