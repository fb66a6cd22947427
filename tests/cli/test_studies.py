"""A study as a user meets it: cells that are ordinary runs, one table, and what happens when some of it fails."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

TOY = (
    "dataset.points=60", "training.steps=20", "evaluation.region_steps=30", "evaluation.region_starts=9",
    "evaluation.contraction_grid_points=5", "evaluation.verify_cells=0",
)  # fmt: skip
VARIANTS = (
    "{label: network, overrides: ['field=mlp','field.hidden_units=[6]']}",
    "{label: thesis, overrides: ['field=line_integral','field.hidden_units=[6]','training.steps=10']}",
)
TITLES = {"train.dtwd_per_point": "DTWD", "contraction.true.rate": "rate", "contraction.jhat.rate": "rate of J"}
COLUMNS = f"[{','.join(f'{{score: {score}, title: {title}}}' for score, title in TITLES.items())}]"
FIGURES = "study.figures=[motions,steps_inside]"


def study(*settings: str, variants: tuple[str, ...] = VARIANTS) -> tuple[str, ...]:
    described = ("study.title=Toy", f"study.variants=[{','.join(variants)}]", f"study.columns={COLUMNS}")
    return ("ncds", "run", *described, "study.datasets=[letters/j]", *TOY, *settings, "output=json")


@pytest.fixture(scope="module")
def toy(start, folder):
    """Its cells in processes of their own."""
    return start(folder, *study(FIGURES, "study.jobs=2")).answer().done()


def read(cell: dict, stage: str, name: str) -> dict:
    return json.loads((Path(cell["stages"][stage]["folder"]) / name).read_text())


def scores_of(answer, variant: str) -> dict:
    (cell,) = [cell for cell in answer.document["cells"] if cell["variant"] == variant]
    return read(cell, "evaluate", "scores.json")["scores"]


def test_the_table_holds_the_scores_of_its_cells(toy):
    table = toy.document["study"]
    assert [row["variant"] for row in table["rows"]] == ["network", "thesis"]
    for row in table["rows"]:
        scores = scores_of(toy, row["variant"])
        for name, value in row["values"].items():
            assert (value["mean"] if value else None) == (scores[name]["value"] if name in scores else None)
    assert table["rows"][0]["values"]["contraction.jhat.rate"] is None


def test_files_hold_the_same_table(toy):
    rows = list(csv.DictReader(toy.artefact("study", "table.csv").open()))
    assert [row["variant"] for row in rows] == ["network", "thesis"]
    for row in rows:
        expected = scores_of(toy, row["variant"])["train.dtwd_per_point"]["value"]
        assert float(row["train.dtwd_per_point"]) == expected
    page = toy.artefact("study", "report.html").read_text()
    assert page.startswith("<!doctype html>") and page.count("<img") == 2 and "Toy" in page
    assert "| letters/j | network |" in toy.artefact("study", "table.md").read_text()
    with np.load(toy.artefact("study", "figures/steps_inside.npz")) as behind:
        assert {"cell_0", "steps_inside_0", "steps_inside_1"} <= set(behind.files)


def test_what_is_typed_beside_a_study_holds_for_every_cell(toy):
    for cell in toy.document["cells"]:
        assert read(cell, "train", "config.json")["training"]["steps"] == 20


def test_a_cell_is_a_run_like_any_other(toy, here):
    cell, _ = toy.document["cells"]
    again = here("ncds", "eval", f"run={cell['stages']['evaluate']['run_id']}", *TOY[2:], "output=json").done()
    assert again.document["scores"]["scores"] == scores_of(toy, "network")


def test_the_same_study_again_in_one_process_reuses_every_cell_and_its_table(toy, here):
    again = here(*study(FIGURES)).done()
    assert again.document["study"] == toy.document["study"]
    assert "train: done" not in again.err and "evaluate: done" not in again.err and "study: done" not in again.err


def test_a_part_of_the_cells_elsewhere_takes_over_what_this_folder_has(toy, here, folder, tmp_path):
    ncds, _, *settings = study(FIGURES, "study.shards=2", "study.shard=1")
    elsewhere = (f"tracking.root={tmp_path}/runs", f"tracking.merge=[{folder}/runs]")
    part = here(ncds, "compare", *settings, *elsewhere).done()
    assert [cell["variant"] for cell in part.document["cells"]] == ["thesis"]
    assert "train: taken over" in part.err and "evaluate: taken over" in part.err
    assert scores_of(part, "thesis") == scores_of(toy, "thesis")


def test_every_method_starts_from_the_same_states(toy):
    with np.load(toy.artefact("study", "initial_conditions.npz")) as kept:
        starts = kept["letters/j, seed 0/demo_0"]
    for variant in ("network", "thesis"):
        (cell,) = [cell for cell in toy.document["cells"] if cell["variant"] == variant]
        with np.load(Path(cell["stages"]["evaluate"]["folder"]) / "evaluation.npz") as behind:
            np.testing.assert_allclose(behind["rollout_0"][:1], starts, atol=1e-6)  # single precision
    assert not [note for note in toy.document["study"]["notes"] if "other starts" in note]


def test_a_failing_cell_is_named_and_the_others_go_on(here, without_shape_checks):
    variants = (VARIANTS[0], "{label: diverging, overrides: ['field=mlp','training.learning_rate=1e30']}")
    answer = here(*study(variants=variants)).done(1)
    table = answer.document["study"]
    (failure,) = table["failures"]
    assert failure.startswith("diverging, letters/j, seed 0: training diverged")
    assert table["rows"][0]["values"]["train.dtwd_per_point"]["mean"] > 0
    assert table["rows"][1]["values"]["train.dtwd_per_point"] is None


MISTAKES = {
    ("eval", "study.jobs=1"): "study.title=Toy is not valid: expected no study here",
    ("run", "study.figures=[motion]"): "unknown study figure 'motion'. Did you mean 'motions'?",
    ("run", "field=linear"): "field=linear is not valid",
    ("run", "study.datasets=[letters/jj]"): "unknown dataset 'letters/jj'",
    ("run", "study.jobs=0"): "study.jobs=0 is not valid",
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_told_before_anything_is_trained(here, mistake):
    verb, setting = mistake
    program, _, *settings = study(setting)
    answer = here(program, verb, *settings)
    assert answer.status == 2
    assert MISTAKES[mistake] in json.loads(answer.out)["error"]["message"]
    assert "train: " not in answer.err


def test_settings_of_no_study_are_a_mistake_too(here):
    answer = here("ncds", "run", "study.datasets=[letters/j]")
    assert answer.status == 2
    assert "study.variants=[] is not valid: expected one or more, as an experiment" in answer.err
