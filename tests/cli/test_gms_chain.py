"""The whole chain of `gms` as a user meets it: commands, stores on disk, standard output and error, exit statuses."""

import json
import os
import re
import signal
from pathlib import Path

import numpy as np
import pytest
import torch

from geomotion.tracking import StageRun

pytestmark = pytest.mark.slow

TRAINING = (
    "manifold.kernels=60", "manifold.points=60", "training.steps=150", "training.spread_steps=40",
    "training.restarts=0",
)  # fmt: skip
GRAPH = ("graph.points_per_axis=30",)
TOY = ("dataset=panda/reach_to_grasp", "dataset.points=60", *TRAINING, *GRAPH, "robot.film=false")
RUN = ("gms", "run", *TOY, "output=json")
STAGES = ("ingest", "train", "graph", "plan", "evaluate", "replay", "report")


@pytest.fixture(scope="module")
def chain(start, folder):
    return start(folder, *RUN).answer().done()


@pytest.fixture
def again(chain) -> tuple[str, ...]:
    """Settings for training on what the chain read, as a user's own recordings."""
    return ("dataset=folder", f"dataset.root={chain.artefact('ingest', '')}", *TRAINING)


class TestRun:
    def test_every_stage_leaves_what_its_contract_says(self, chain):
        assert list(chain.document["stages"]) == list(STAGES)
        for stage, names in {
            "ingest": ["meta/info.json", "summary.json"],
            "train": ["model.pt", "training.json", "training.csv", "spreads.csv"],
            "graph": ["surface.npz", "graph.json", "maps.npz"],
            "plan": ["plan.json", "path.npz", "scene.html", "figures/plan.png"],
            "evaluate": ["scores.json", "evaluation.npz"],
            "replay": ["replay.json", "trajectory/meta/info.json"],
            "report": ["report.html", "scene.html"],
        }.items():
            for name in [*names, "config.json", "environment.json"]:
                assert chain.artefact(stage, name).stat().st_size > 0

    def test_standard_error_tells_the_stages(self, chain):
        lines = [line for line in chain.err.splitlines() if ": done in" in line]
        assert [line.partition(":")[0] for line in lines] == list(STAGES)

    def test_a_path_was_found_judged_and_executed(self, chain):
        document = chain.document
        assert document["plan"]["found"]
        assert document["scores"]["scores"]["heldout.planned_share"]["value"] == 1
        assert document["replay"]["executed"]
        assert document["replay"]["reached_share"] == 1
        assert document["replay"]["tracking_worst_m"] < 0.005

    def test_the_same_command_again_reuses_every_stage(self, chain, here):
        again = here(*RUN).done()
        assert again.document["stages"] == chain.document["stages"]
        lines = again.err.splitlines()
        assert lines[0].startswith("ingest: done")  # the outside world is read anew each time
        assert [bool(re.fullmatch(r"\w+: reused run [0-9a-f]{8}", line)) for line in lines[1:]] == [True] * 6


class TestOneTrainedRun:
    """``run=`` names it by id, by a beginning of the id, by a path, or as the latest."""

    def test_every_name_of_a_run_finds_the_same_model(self, chain, here):
        train = chain.document["stages"]["train"]
        for name in (train["run_id"], train["run_id"][:10], train["folder"], chain.document["run_id"], "latest"):
            assert here("gms", "train", f"run={name}", "output=json").done().document["stages"]["train"] == train

    def test_judging_it_again_gives_the_same_scores(self, chain, here):
        train = chain.run_id("train")
        answer = here("gms", "eval", f"run={train}", *GRAPH, "reuse=false", "output=json").done()
        assert "evaluate: done" in answer.err
        assert answer.document["scores"] == chain.document["scores"]

    def test_the_latest_is_planned_executed_and_reported(self, chain, here):
        settings = ("run=latest", *GRAPH, "robot.film=false")
        planned = here("gms", "plan", *settings, "planning.start=demo:0", "planning.goal=demo:1").done()
        assert re.search(r"start of demonstration 0 to end of demonstration 1 +found", planned.out)
        assert Path(re.search(r"^path +(.*)$", planned.out, re.MULTILINE)[1]).is_file()
        assert "reached by inverse kinematics  100.0%" in here("gms", "replay", *settings).done().out
        assert Path(here("gms", "report", *settings, "output=json").done().document["report"]).is_file()

    def test_a_training_override_beside_run_is_refused(self, chain, here):
        answer = here("gms", "eval", f"run={chain.document['run_id']}", "manifold.kernels=5")
        assert (answer.status, answer.out) == (2, "")
        assert answer.err.startswith("gms eval: error: manifold.kernels=5 is not valid")
        assert answer.err.count("\n") == 1


def test_a_sweep_over_seeds_is_compared(again, here):
    sweep = here("gms", "train", "-m", *again, "seed=0,1", "output=json").done()
    documents = [json.loads(line) for line in sweep.out.splitlines()]
    runs = [one["stages"]["train"]["run_id"] for one in documents]
    assert runs[0] != runs[1]
    text = here("gms", "compare", f"runs=[{','.join(runs)}]", *GRAPH).done().out
    assert "heldout.position_dtwd_ratio" in text
    assert all(run in text for run in runs)


def test_both_programs_share_a_store_and_find_their_own_runs(chain, here):
    toy = ("dataset=letters/j", "dataset.points=40", "chart.layers=1", "chart.features=8", "training.steps=5")
    other = here("ncds", "train", *toy, "output=json").done().document["run_id"]
    assert "contraction" in here("ncds", "train", "run=latest").done().out
    assert "latent space" in here("gms", "train", "run=latest").done().out
    for run, program, trainer in ((other, "gms", "ncds"), (chain.run_id("train"), "ncds", "gms")):
        answer = here(program, "eval", f"run={run}")
        assert (answer.status, answer.out) == (1, "")
        assert re.fullmatch(rf"{program} eval: error: run={run}: it was trained by `{trainer} \w+`.*\n", answer.err)


def test_an_interrupted_training_goes_on_to_the_same_model(again, here, folder, monkeypatch):
    command = ("gms", "train", *again, "seed=7", "training.checkpoint_every_steps=10", "output=json")
    with monkeypatch.context() as patched:
        patched.setattr(StageRun, "log_series", lambda *_: os.kill(os.getpid(), signal.SIGINT))
        stopped = here(*command)
    assert stopped.status == 130
    assert "Repeat the command to continue where it stopped." in stopped.err
    assert len(list((folder / "runs/work").glob("*.checkpoint*"))) == 1
    resumed, repeated = here(*command).done(), here(*command, "reuse=false").done()
    assert "train: continues at step" in resumed.err and "continues" not in repeated.err
    assert not list((folder / "runs/work").glob("*.checkpoint*"))
    one, other = (
        torch.load(answer.artefact("train", "model.pt"), weights_only=True)["parameters"]
        for answer in (resumed, repeated)
    )
    assert resumed.run_id("train") != repeated.run_id("train")
    for name, values in one.items():
        torch.testing.assert_close(values, other[name], rtol=0, atol=0)


def test_a_way_between_antipodal_clusters_is_told_by_its_energy_and_not_executed(again, here):
    """Fig. 3.6: start and goal are one orientation's two signs, each in a cluster of its own."""
    ends = ("planning.start=demo:0", "planning.goal=antipode:0")
    anywhere = ("planning.leave_data_m=10", "planning.leave_data_rad=4")
    answer = here("gms", "replay", *again, *GRAPH, "manifold.antipodal=doubled", *ends, *anywhere, "output=json").done(
        3
    )
    plan = json.loads(answer.artefact("plan", "plan.json").read_text())
    (leg,) = plan["legs"]
    assert leg["status"] == "crosses"
    crossing = json.loads(answer.artefact("graph", "graph.json").read_text())["crossing_length"]
    assert leg["scores"]["energy"] > crossing**2
    assert f"{leg['scores']['energy']:.3g}" in leg["reason"]
    assert answer.document["replay"] == {"executed": False, "reason": leg["reason"]}
    assert not answer.artefact("plan", "path.npz").exists()
    assert not answer.artefact("replay", "trajectory").exists()


def test_three_latent_dimensions_work(again, here):
    settings = ("manifold.latent_dim=3", "graph.points_per_axis=12", "output=json")
    answer = here("gms", "eval", *again, *settings).done()
    assert np.isfinite(answer.document["scores"]["scores"]["heldout.position_dtwd_ratio"]["value"])
