"""The whole chain as a user meets it: commands, stores on disk, standard output and error, exit statuses."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

TOY = (
    "dataset.points=60", "chart.layers=2", "chart.features=8", "training.steps=30",
    "evaluation.region_steps=50", "evaluation.region_starts=9", "evaluation.contraction_grid_points=5",
)  # fmt: skip
RUN = ("ncds", "run", "dataset=letters/j", *TOY, "output=json")
STAGES = ("ingest", "train", "rollout", "evaluate", "export", "report")


@pytest.fixture(scope="module")
def linear(start, folder):
    return start(folder, *RUN).answer().done()


@pytest.fixture
def line_integral(here):
    """Run once, reused then."""
    settings = [setting for setting in TOY if not setting.startswith("chart.")]
    thesis = ("field=line_integral", "field.hidden_units=[6,6]", "evaluation.verify_cells=0")
    return here("ncds", "eval", "dataset=letters/j", *settings, *thesis, "output=json").done()


class TestRun:
    def test_every_stage_leaves_what_its_contract_says(self, linear):
        assert list(linear.document["stages"]) == list(STAGES)
        for stage, names in {
            "ingest": ["meta/info.json", "data/chunk-000/file-000.parquet", "summary.json"],
            "train": ["model.pt", "training.csv", "certificate.json"],
            "rollout": ["rollouts/meta/info.json", "rollouts.json"],
            "evaluate": ["scores.json", "certificate.json", "evaluation.npz"],
            "export": ["policy.onnx", "policy.json", "policy_example.py"],
            "report": ["report.html"],
        }.items():
            for name in [*names, "config.json", "environment.json"]:
                assert linear.artefact(stage, name).stat().st_size > 0

    def test_the_certificate_holds_by_construction_at_a_positive_rate(self, linear):
        certificate = linear.read("evaluate", "certificate.json")
        assert certificate["claim"] == "by_construction"
        assert certificate["rate_per_s"] > 0
        assert certificate["audit"]["contraction.claimed.non_contracting_fraction"] == 0
        assert linear.document["certificate"] == certificate

    def test_scores_are_finite_and_printed_as_they_are_stored(self, linear):
        scores = linear.read("evaluate", "scores.json")
        assert linear.document["scores"] == scores
        assert {"train.dtwd_per_point", "heldout.ratio_to_nearest_demo", "region.steps_inside"} <= set(scores["scores"])
        assert all(np.isfinite(score["value"]) for score in scores["scores"].values())

    def test_rollouts_begin_where_the_demonstrations_do(self, linear):
        from geomotion.demos import storage

        demonstrations = storage.load(linear.artefact("ingest", ""))
        rollouts = storage.load(linear.artefact("rollout", "rollouts"))
        assert len(rollouts) == len(demonstrations) == 7
        for rollout, demonstration in zip(rollouts.trajectories, demonstrations.trajectories, strict=True):
            np.testing.assert_allclose(
                rollout.channels["position_m"][0], demonstration.channels["position_m"][0], atol=1e-6
            )
            assert rollout.duration_s == pytest.approx(demonstration.duration_s)

    def test_the_exported_model_equals_the_trained_one(self, linear):
        import mlflow

        from geomotion import models

        mlflow.set_tracking_uri(f"sqlite:///{linear.artefact('export', '').parents[2]}/mlflow.db")
        policy = mlflow.pyfunc.load_model(f"runs:/{linear.document['stages']['export']['run_id']}/policy")
        skill = models.load(linear.artefact("train", "model.pt"))
        box = torch.rand(50, 2, generator=torch.Generator().manual_seed(0)) * 0.1
        elapsed_s = torch.linspace(0, 4, 50)[:, None]
        with torch.no_grad():
            expected = skill.field(box, elapsed_s).numpy()
        scale = np.abs(expected).max()
        found = policy.predict({"state_m": box.numpy(), "elapsed_s": elapsed_s.numpy()})
        np.testing.assert_allclose(found["velocity_m_per_s"], expected, atol=1e-5 * scale)

    def test_the_example_beside_the_policy_follows_it_to_the_goal(self, linear):
        script = linear.artefact("export", "policy_example.py")
        assert "geomotion" not in script.read_text()
        told = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True).stdout
        assert re.fullmatch(r"0\.\d+ ms a query, worst status 0, 0\.00\d+ from the goal at the end\n", told)

    def test_standard_error_tells_the_stages_and_nothing_else(self, linear):
        assert [line.partition(":")[0] for line in linear.err.splitlines()] == list(STAGES)

    def test_the_same_command_again_reuses_every_stage(self, linear, here):
        again = here(*RUN).done()
        assert again.document["stages"] == linear.document["stages"]
        lines = again.err.splitlines()
        assert lines[0].startswith("ingest: done")  # the outside world is read anew each time
        assert [bool(re.fullmatch(r"\w+: reused run [0-9a-f]{8}", line)) for line in lines[1:]] == [True] * 5

    def test_the_thesis_field_is_measured_and_found_not_to_contract(self, line_integral):
        certificate = line_integral.read("evaluate", "certificate.json")
        assert certificate["claim"] == "measured_only"
        assert certificate["rate_per_s"] is None
        share = line_integral.document["scores"]["scores"]["contraction.true.non_contracting_fraction"]["value"]
        assert 0 <= share <= 1
        assert certificate["audit"]["contraction.true.non_contracting_fraction"] == share


class TestOneTrainedRun:
    """``run=`` names it by id, by a beginning of the id, by a path, or as the latest."""

    def test_every_name_of_a_run_finds_the_same_model(self, linear, here):
        train = linear.document["stages"]["train"]
        names = (train["run_id"], train["run_id"][:10], train["folder"], linear.document["run_id"])
        for name in names:
            assert here("ncds", "train", f"run={name}", "output=json").done().document["stages"]["train"] == train

    def test_latest_is_the_one_used_last(self, linear, line_integral, here):
        for answer in (linear, line_integral):
            train = answer.document["stages"]["train"]
            here("ncds", "train", f"run={train['run_id']}").done()
            assert here("ncds", "train", "run=latest", "output=json").done().document["stages"]["train"] == train

    def test_another_evaluation_needs_no_training(self, linear, here):
        train = linear.document["stages"]["train"]["run_id"]
        settings = [setting for setting in TOY if setting.startswith("evaluation.")]
        answer = here("ncds", "eval", f"run={train}", *settings, "evaluation=peers", "output=json").done()
        assert answer.document["scores"]["protocol"] == "peers"
        assert answer.document["stages"]["train"]["run_id"] == train
        assert "train: " not in answer.err
        assert "heldout.dtw" not in answer.document["scores"]["scores"]

    def test_a_rollout_starts_where_it_is_told(self, linear, here):
        from geomotion.demos import storage

        train = linear.document["stages"]["train"]["run_id"]
        where = ("rollout.starts_m=[[0.02,0.03],[0.01,0.0]]", "rollout.duration_s=1.5", "rollout.points=20")
        answer = here("ncds", "rollout", f"run={train}", *where, "output=json").done()
        rollouts = storage.load(answer.artefact("rollout", "rollouts"))
        starts = [one.channels["position_m"][0] for one in rollouts.trajectories]
        np.testing.assert_allclose(starts, [[0.02, 0.03], [0.01, 0.0]], atol=1e-6)
        assert [(len(one), one.duration_s) for one in rollouts.trajectories] == [(20, 1.5)] * 2
        assert len(answer.document["rollouts"]["rollouts"]) == 2

    def test_a_report_is_written_of_a_run(self, linear, here):
        settings = [setting for setting in TOY if setting.startswith("evaluation.")]
        answer = here("ncds", "report", f"run={linear.document['run_id']}", *settings, "output=json").done()
        assert Path(answer.document["report"]).read_text().startswith("<!doctype html>")

    def test_runs_are_compared(self, linear, line_integral, here):
        runs = [answer.document["stages"]["train"]["run_id"] for answer in (linear, line_integral)]
        settings = [setting for setting in TOY if setting.startswith("evaluation.")]
        answer = here("ncds", "compare", f"runs=[{','.join(runs)}]", *settings, "output=json").done()
        assert answer.document["comparison"]
        text = here("ncds", "compare", f"runs=[{','.join(runs)}]", *settings).done().out
        assert "dtwd_per_point" in text

    def test_a_training_override_beside_run_is_refused(self, linear, here):
        answer = here("ncds", "eval", f"run={linear.document['run_id']}", "training.steps=5")
        assert (answer.status, answer.out) == (2, "")
        assert answer.err.startswith("ncds eval: error: training.steps=5 is not valid")
        assert answer.err.count("\n") == 1


def test_ingest_prints_a_table_and_is_one_document_for_programs(linear, here):
    for program in ("gms", "ncds"):
        answer = here(program, "ingest", "dataset=letters/s", "dataset.points=60").done()
        picture = re.search(r"^picture  (.*)$", answer.out, re.MULTILINE)
        assert Path(picture[1]).read_bytes().startswith(b"\x89PNG")
        document = here(program, "ingest", "dataset=letters/s", "dataset.points=60", "output=json").done()
        assert len(document.document["summary"]["demos"]) == 7


def test_commands_at_the_same_time_on_a_fresh_store_succeed_with_the_same_scores(start, linear, tmp_path):
    judge = ("ncds", "eval", "dataset=letters/j", *TOY, "output=json")
    same_training = ("ncds", "train", "dataset=letters/j", *TOY, "output=json")
    judged, trained = [command.answer().done() for command in [start(tmp_path, *one) for one in (judge, same_training)]]
    assert judged.document["stages"]["train"] == trained.document["stages"]["train"]
    # a fresh store and a repeated training change nothing: the seed decides
    assert judged.document["scores"] == linear.document["scores"]


def test_a_sweep_keeps_what_succeeds_and_fails_for_what_does_not(here):
    settings = [setting for setting in TOY if not setting.startswith("training.")]
    rates = ("training.steps=8", "training.learning_rate=0.01,1e30,0.02")
    sweep = here("ncds", "train", "-m", "dataset=letters/j", *settings, *rates, "output=json").done(1)
    first, failed, last = (json.loads(line) for line in sweep.out.splitlines())
    assert failed["error"]["type"] == "TrainingDiverged"
    assert len([line for line in sweep.err.splitlines() if "error" in line]) == 1
    for document in (first, last):
        assert here("ncds", "train", f"run={document['run_id']}", "output=json").done().document["certificate"]
