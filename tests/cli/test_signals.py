"""Trainings that are stopped by Ctrl-C, by a termination signal and without warning, and go on to the same result."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import torch

STEPS = 400
TRAIN = (
    "train", "dataset=letters/j", "dataset.points=60", "chart.layers=2", "chart.features=8",
    f"training.steps={STEPS}", "training.checkpoint_every_steps=5", "output=json",
)  # fmt: skip


class Training:
    """One ``ncds train`` in its own process."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.folder = folder
        # Interactive shells start commands like this; a test runner in the background has Ctrl-C switched off.
        command = f"import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); {MAIN}"
        self.process = subprocess.Popen(
            [sys.executable, "-c", command, *TRAIN, *arguments],
            cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    def stop(self, number: signal.Signals) -> None:
        """Send a signal as soon as this process has written a checkpoint."""
        before = self._newest_checkpoint()
        deadline = time.monotonic() + 300
        while self._newest_checkpoint() == before:
            assert self.process.poll() is None, self.process.communicate()
            assert time.monotonic() < deadline
            time.sleep(0.01)
        self.process.send_signal(number)

    def end(self) -> tuple[int, str, str]:
        out, err = self.process.communicate(timeout=300)
        return self.process.returncode, out, err

    def _newest_checkpoint(self) -> int:
        return max((path.stat().st_mtime_ns for path in self.folder.glob("runs/work/*.checkpoint")), default=0)


MAIN = "from geomotion_cli.dispatch import main; sys.exit(main('ncds', sys.argv[1:]))"


def statuses(folder: Path) -> list[str]:
    """Of the runs of the stage, oldest first."""
    from mlflow import MlflowClient

    client = MlflowClient(f"sqlite:///{folder}/runs/mlflow.db")
    experiment = client.get_experiment_by_name("geomotion").experiment_id
    found = client.search_runs([experiment], "tags.`geomotion.stage` = 'train'", order_by=["start_time ASC"])
    return [run.info.status for run in found]


@pytest.fixture
def folder(fresh_store) -> Path:
    return fresh_store.parent


@pytest.mark.slow
def test_a_training_stopped_three_times_ends_as_one_that_was_left_alone(folder, here):
    reached = None  # step at which the previous attempt began; the first one does not say that it begins
    for number, exit_code, status in (
        (signal.SIGINT, 130, "KILLED"),
        (signal.SIGTERM, 143, "KILLED"),
        (signal.SIGKILL, -signal.SIGKILL, "RUNNING"),
    ):
        training = Training(folder)
        training.stop(number)
        code, out, err = training.end()
        assert code == exit_code, err
        assert "Traceback" not in err
        assert statuses(folder) == [status]
        if number is not signal.SIGKILL:
            (error,) = [line for line in err.splitlines() if "error" in line]
            assert (
                error
                == f"ncds train: error: stopped by signal {number:d}. Repeat the command to continue where it stopped."
            )
            assert json.loads(out)["error"]["type"] == "Interrupted"
        begun = re.findall(rf"train: continues at step (\d+) of {STEPS}", err)
        assert begun == [] if reached is None else int(begun[0]) > reached
        reached = int(begun[0]) if begun else 0

    continued = here("ncds", *TRAIN).done()
    assert "train: continues at step" in continued.err
    assert statuses(folder) == ["FINISHED"]
    assert not [path for path in (folder / "runs/work").iterdir() if path.suffix != ".lock"]

    undisturbed = here("ncds", *TRAIN, "reuse=false").done()
    assert "continues" not in undisturbed.err
    assert undisturbed.run_id("train") != continued.run_id("train")
    one, other = (answer.artefact("train", "training.csv").read_text() for answer in (undisturbed, continued))
    assert one == other
    one, other = (
        torch.load(answer.artefact("train", "model.pt"), weights_only=True)["parameters"]
        for answer in (undisturbed, continued)
    )
    torch.testing.assert_close(one, other, rtol=0, atol=0)


@pytest.mark.slow
def test_ctrl_c_before_the_training_starts_is_one_line_too(folder):
    training = Training(folder, "dataset=letters/s")
    deadline = time.monotonic() + 300
    while not list(folder.glob("runs/work/*.lock")):  # the first stage has begun
        assert training.process.poll() is None and time.monotonic() < deadline
        time.sleep(0.01)
    os.kill(training.process.pid, signal.SIGINT)
    code, _, err = training.end()
    assert code == 130
    assert len([line for line in err.splitlines() if "error" in line]) == 1
    assert "Traceback" not in err
