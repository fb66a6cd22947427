"""Bad input meets one clear line, a non-zero status and a store in which nothing half-done counts as done."""

import os
import resource
import signal
import sqlite3
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from geomotion.tracking import StageRun, store

TOY = (
    "dataset=letters/j", "dataset.points=60", "chart.layers=2", "chart.features=8", "training.steps=20",
    "training.checkpoint_every_steps=5", "training.log_every_steps=1",
)  # fmt: skip
TIME_S = np.linspace(0, 1, 30)
GOOD = {"time_s": TIME_S, "x": TIME_S, "y": TIME_S**2}


def csv(folder: Path, number: int = 0, **changes) -> None:
    pd.DataFrame(GOOD | changes).to_csv(folder / f"{number}.csv", index=False)


def with_cell(name: str, row: int, value: float) -> dict[str, np.ndarray]:
    column = GOOD[name].copy()
    column[row] = value
    return {name: column}


def truncated_npz(folder: Path) -> None:
    np.savez(folder / "0.npz", **GOOD)
    content = (folder / "0.npz").read_bytes()
    (folder / "0.npz").write_bytes(content[: len(content) // 2])


def truncated_parquet(folder: Path) -> None:
    pd.DataFrame(GOOD).to_parquet(folder / "0.parquet")
    content = (folder / "0.parquet").read_bytes()
    (folder / "0.parquet").write_bytes(content[: len(content) // 2])


def truncated_csv(folder: Path) -> None:
    csv(folder)
    (folder / "0.csv").write_text((folder / "0.csv").read_text().rsplit(",", 1)[0])


def of_different_dimension(folder: Path) -> None:
    csv(folder, 0)
    csv(folder, 1, z=TIME_S)


RECORDINGS: dict[str, tuple[Callable[[Path], None], str]] = {
    "a NaN": (lambda folder: csv(folder, **with_cell("x", 3, np.nan)), "row 3"),
    "an infinity": (lambda folder: csv(folder, **with_cell("y", 4, np.inf)), "row 4"),
    "times that go back": (lambda folder: csv(folder, **with_cell("time_s", 5, 0.01)), "expected increasing times"),
    "a time twice": (lambda folder: csv(folder, **with_cell("time_s", 5, TIME_S[4])), "repeats"),
    "one point": (
        lambda folder: pd.DataFrame({"time_s": [0.0], "x": [0.0], "y": [0.0]}).to_csv(folder / "0.csv", index=False),
        "has 1 point(s)",
    ),
    "different dimensions": (of_different_dimension, "as in demonstration 0"),
    "an empty folder": (lambda folder: None, "holds no recording"),
    "a truncated npz": (truncated_npz, "truncated"),
    "a truncated parquet": (truncated_parquet, "truncated"),
    "a truncated csv": (truncated_csv, "expected finite numbers"),
    "dates": (lambda folder: pd.DataFrame(GOOD | {"time_s": pd.to_datetime(TIME_S)}).to_parquet(folder / "0.parquet"),
              "expected numbers"),
}  # fmt: skip


@pytest.mark.parametrize("what", RECORDINGS)
def test_bad_recordings_are_refused_by_name(what, tmp_path, refused):
    write, words = RECORDINGS[what]
    write(tmp_path)
    refused(("ncds", "train", "dataset=folder", f"dataset.root={tmp_path}"), words, "ingest")


def test_good_recordings_in_the_same_place_then_work(tmp_path, here, refused):
    csv(tmp_path, **with_cell("x", 3, np.nan))
    refused(("ncds", "ingest", "dataset=folder", f"dataset.root={tmp_path}"), "row 3", "ingest")
    csv(tmp_path)
    here("ncds", "ingest", "dataset=folder", f"dataset.root={tmp_path}").done()


def test_a_damaged_lasa_file_is_refused(tmp_path, refused):
    (tmp_path / "Angle.mat").write_bytes(b"MATLAB 5.0 MAT-file" + bytes(200))
    refused(
        ("ncds", "ingest", "dataset=lasa/angle", f"dataset.root={tmp_path}"),
        "Angle.mat: not a LASA recording",
        "ingest",
    )


SETTINGS = {
    "an unknown shape": (("dataset=letters/q",), "unknown dataset 'letters/q'", 2, "ingest"),
    "an unknown key": (("training.stepz=3",), "Did you mean 'training.steps'?", 2, "ingest"),
    "an unknown value": (("field=liner",), "Did you mean 'linear'?", 2, "ingest"),
    "a missing folder": (("dataset=folder", "dataset.root=nowhere"), "does not exist", 1, "ingest"),
    "a demonstration that is not there": (("dataset.train_demos=[0,9]",), "different numbers from 0 to 6", 2, "ingest"),
    "no training demonstration": (("dataset.train_demos=[]",), "at least one", 2, "ingest"),
    "tests that are trained on": (
        ("dataset.train_demos=[0,1]", "dataset.test_demos=[1,2]"), "none of dataset.train_demos", 2, "ingest",
    ),
    "too few points for the trimming": (("dataset.points=10",), "at least two points left", 2, "ingest"),
    "a channel twice": (("dataset.state_channels=[position_m,position_m]",), "different channels", 2, "ingest"),
    "a seed below zero": (("seed=-1",), "seed=-1 is not valid", 2, "ingest"),
    "a seed of the data below zero": (("dataset.seed=-1",), "dataset.seed=-1 is not valid", 2, "ingest"),
    "a regulariser that does not go with the field": (("regulariser=constant",), "expected none", 2, "train"),
    "a training that does not go with the field": (
        ("field=line_integral", "training=trajectory", "chart=identity"), "training=trajectory", 2, "train",
    ),
    "a learning rate far too high": (("training.learning_rate=1e30",), "training diverged", 1, "train"),
}  # fmt: skip


@pytest.mark.parametrize("what", SETTINGS)
def test_settings_that_make_no_sense_are_refused(what, refused):
    settings, words, status, stage = SETTINGS[what]
    toy = TOY if not any("=" in one and one.startswith(("dataset=folder", "field")) for one in settings) else ()
    refused(("ncds", "train", *toy, *settings), words, stage, status)


def test_pictures_need_trajectories_in_closed_form_and_say_so_at_once(refused):
    command = ("ncds", "run", "dataset=panda/grasp_and_drop", "field=potential", "training=velocity")
    refused(command, "encoder.trajectory_weight=1.0 is not valid: expected 0, but for field=linear", "ingest", 2)


def recordings(folder: Path, count: int, points: int = 30, **columns) -> Path:
    folder.mkdir()
    for number in range(count):
        time_s = np.linspace(0, 1, points)
        values = {name: function(time_s) + 0.01 * number * (1 - time_s) for name, function in columns.items()}
        pd.DataFrame({"time_s": time_s, **values}).to_csv(folder / f"{number}.csv", index=False)
    return folder


def test_a_flow_needs_two_dimensions(tmp_path, refused, here):
    root = recordings(tmp_path / "one", 3, x=np.square)
    learn = ("ncds", "train", "dataset=folder", f"dataset.root={root}", "training.steps=5")
    refused(learn, "use chart=identity in one dimension", "train", 2)
    here(*learn, "chart=identity").done()


def test_recordings_that_stand_still_are_refused(tmp_path, refused):
    root = recordings(tmp_path / "still", 1, x=np.ones_like, y=np.ones_like)
    refused(("ncds", "train", "dataset=folder", f"dataset.root={root}"), "expected motion", "train")


@pytest.mark.parametrize(("demos", "points"), [(1, 30), (2, 2), (3, 3)])
def test_few_demonstrations_and_points_are_enough_for_a_training(tmp_path, here, demos, points):
    root = recordings(tmp_path / "few", demos, points, x=np.square, y=np.cos)
    assert here("ncds", "train", "dataset=folder", f"dataset.root={root}", *TOY[2:]).done().complaints == []


class TestARun:
    @pytest.fixture
    @staticmethod
    def trained(here) -> None:
        """Trained once, reused then."""
        here("ncds", "train", *TOY).done()

    @pytest.mark.parametrize(
        ("settings", "words", "status"),
        [
            (("run=deadbeef",), "no such run in the store", 1),
            (("run=nowhere/model.pt",), "not inside the artefacts of a run", 1),
            (("run=latest", "chart.layers=3"), "training is finished", 2),
            (("run=latest", "tracking.root=elsewhere"), "there is no store in elsewhere/", 1),
            (("run=latest", "rollout.starts_m=[[1.0,2.0,3.0]]"), "2 coordinates", 2),
            (("run=latest", "rollout.starts_m=[]"), "one start or more", 2),
            (("run=latest", "rollout.starts_m=[[1e30,0.0]]"), "stays finite", 2),
            (("run=latest", "rollout.demos=[99]"), "numbers 0 to 6", 1),
            (("run=latest", "rollout.points=1"), "rollout.points=1 is not valid", 2),
        ],
    )
    def test_what_cannot_be_followed_is_refused(self, trained, refused, settings, words, status):
        refused(("ncds", "rollout", *settings), words, "rollout", status)

    def test_peers_scores_need_their_training_set(self, here, refused):
        here("ncds", "train", *TOY, "dataset.train_demos=[0,1]").done()
        refused(("ncds", "eval", "run=latest", "evaluation=peers"), "expected", "evaluate", 2)

    def test_comparing_needs_a_store(self, refused):
        refused(("ncds", "compare", "runs=[latest,latest]", "tracking.root=elsewhere"), "there is no store", "evaluate")

    def test_a_damaged_model_is_noticed_and_trained_anew(self, here, refused):
        command = ("ncds", "train", *TOY, "seed=5", "output=json")
        model = here(*command).done().artefact("train", "model.pt")
        content = model.read_bytes()
        model.write_bytes(content[: len(content) // 2])
        refused(("ncds", "rollout", "run=latest"), "is corrupt", "rollout")
        again = here(*command).done().artefact("train", "model.pt")
        assert again != model
        assert again.read_bytes() == content

    def test_a_damaged_checkpoint_is_named_and_a_fresh_start_works(self, here, refused, folder, monkeypatch):
        command = ("ncds", "train", *TOY, "seed=6")
        before = set((folder / "runs/work").glob("*.checkpoint"))
        with monkeypatch.context() as patched:
            patched.setattr(StageRun, "log_series", lambda *_: os.kill(os.getpid(), signal.SIGINT))
            stopped = here(*command).done(130)
        assert stopped.complaints == [
            "ncds train: error: stopped by signal 2. Repeat the command to continue where it stopped."
        ]
        (checkpoint,) = set((folder / "runs/work").glob("*.checkpoint")) - before
        checkpoint.write_bytes(checkpoint.read_bytes()[:100])
        refused(command, f"{checkpoint} is corrupt", "train")
        here(*command, "reuse=false").done()
        assert not checkpoint.exists()


class TestTheStore:
    def test_a_locked_one_is_reported(self, here, folder, monkeypatch):
        monkeypatch.setattr(store, "BUSY_TIMEOUT_S", 0.2)
        other = sqlite3.connect(folder / "runs/mlflow.db", isolation_level=None)
        try:
            other.execute("PRAGMA locking_mode=EXCLUSIVE")
            other.execute("BEGIN EXCLUSIVE")
            answer = here("ncds", "ingest").done(1)
        finally:
            other.close()
        assert answer.out == ""
        (line,) = answer.complaints
        assert "the database is locked by another program. Set tracking.root=" in line
        here("ncds", "ingest").done()

    def test_a_folder_that_cannot_be_written_is_reported(self, here, tmp_path):
        if os.geteuid() == 0:
            pytest.skip("permissions do not bind the superuser")
        tmp_path.chmod(0o500)
        answer = here("ncds", "train", f"tracking.root={tmp_path}/runs").done(1)
        assert answer.out == ""
        (line,) = answer.complaints
        assert "Permission denied" in line

    @pytest.mark.parametrize(
        ("stage", "large"),
        [
            ("ingest", ("dataset.points=100000",)),
            ("train", ("dataset.points=60", "field=line_integral", "field.hidden_units=[900,900]", "training.steps=1")),
        ],
    )
    def test_a_full_disk_is_reported_and_space_mends_it(self, refused, here, folder, stage, large):
        """A limit on the size of files stands in for the disk: writing beyond it fails in the same way."""
        command = ("ncds", stage, "dataset=letters/j", *large)
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        limit = (folder / "runs/mlflow.db").stat().st_size + 2**20
        try:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
            refused(command, "no space left while writing", stage)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        here(*command).done()
