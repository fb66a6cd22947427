"""Commands of `ncds` and `gms`: in this process or their own, with the pipeline or a stand-in for it."""

import ctypes
import json
import logging
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Self

import pytest

from geomotion_cli.dispatch import main


@dataclass
class Answer:
    """What a command left behind."""

    status: int
    out: str
    err: str

    def done(self, status: int = 0) -> Self:
        """Itself, having ended with `status`."""
        assert self.status == status, self.err
        return self

    @property
    def document(self) -> Any:
        """What it printed with ``output=json``."""
        return json.loads(self.out)

    @property
    def complaints(self) -> list[str]:
        """Lines of standard error, less those that tell how far the stages are and how a toy is learned."""
        progress = (": done in", ": reused", "latent space of attempt", "train: broke down at step")
        return [line for line in self.err.splitlines() if not any(words in line for words in progress)]

    def run_id(self, stage: str) -> str:
        return self.document["stages"][stage]["run_id"]

    def artefact(self, stage: str, name: str) -> Path:
        return Path(self.document["stages"][stage]["folder"]) / name

    def read(self, stage: str, name: str) -> Any:
        return json.loads(self.artefact(stage, name).read_text())


class Command:
    """``Command(folder, "ncds", "train", …)`` runs in a process of its own, from `folder`."""

    def __init__(self, folder: Path, *words: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "geomotion_cli", *words],
            cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    def answer(self) -> Answer:
        """Wait until it ends."""
        out, err = self._process.communicate(timeout=300)
        return Answer(self._process.returncode, out, err)


@pytest.fixture(scope="session")
def start() -> type[Command]:
    return Command


@pytest.fixture
def pipeline() -> Callable[..., SimpleNamespace]:
    """A noisy pipeline whose outcome is chosen by ``seed=``; a closure, so that a sweep's workers can receive it."""

    def run_verb(verb, config, overrides):
        from geomotion.errors import Interrupted, MissingRun

        print("printed noise")
        ctypes.CDLL(None).puts(b"noise from C")
        os.system("echo noise from a child")
        match config.seed:
            case 101:
                raise MissingRun("lost", "there is no such run")
            case 102:
                raise RuntimeError("two\nlines")
            case 103:
                raise Interrupted(signal.SIGTERM, "Repeat the command to continue.")
            case 104:
                return SimpleNamespace(text="worse", document={"worse": True}, exit_code=1, objective=None)
            case 105:
                raise KeyboardInterrupt
            case 106:
                return SimpleNamespace(text="", document={"score": float("nan")}, exit_code=0, objective=None)
        document = {"verb": verb, "config": type(config).__name__, "overrides": overrides}
        return SimpleNamespace(text=f"done {verb}", document=document, exit_code=0, objective=0.25)

    return run_verb


@pytest.fixture
def undisturbed(monkeypatch) -> None:
    """What a command changes in its process is put back: its arguments, its environment, the loggers."""
    monkeypatch.setattr(sys, "argv", sys.argv)
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")
    root, own = logging.getLogger(), logging.getLogger("geomotion")
    handlers, level = root.handlers[:], root.level
    for name in ("handlers", "level", "propagate"):
        monkeypatch.setattr(own, name, getattr(own, name))
    yield
    root.handlers[:], root.level = handlers, level


@pytest.fixture
def command(monkeypatch, tmp_path, capfd, pipeline, undisturbed) -> Callable[..., Answer]:
    """``command("train", "seed=1")`` answers like ``ncds train seed=1``, in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str, program: str = "ncds") -> Answer:
        status = main(program, list(arguments), pipeline)
        return Answer(status, *capfd.readouterr())

    return call


@pytest.fixture(scope="module")
def folder(_empty_store: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where all commands of a file are typed, with a store that holds nothing yet."""
    folder = tmp_path_factory.mktemp("a folder")  # spaces have to do no harm
    shutil.copytree(_empty_store, folder / "runs")
    return folder


@pytest.fixture
def here(folder, monkeypatch, capfd, undisturbed) -> Callable[..., Answer]:
    """``here("ncds", "train", …)`` runs the pipeline in this process, where libraries are imported already."""
    monkeypatch.chdir(folder)

    def call(program: str, *arguments: str) -> Answer:
        return Answer(main(program, list(arguments)), *capfd.readouterr())

    return call


@pytest.fixture
def refused(here, folder) -> Callable[..., None]:
    """Assert that a command fails with one line that says `words`, and that `stage` then has no finished run more."""

    def finished(stage: str) -> int:
        with sqlite3.connect(folder / "runs/mlflow.db") as database:
            rows = database.execute("SELECT count(*) FROM runs WHERE name = ? AND status = 'FINISHED'", [stage])
            return rows.fetchone()[0]

    def check(command: tuple[str, ...], words: str, stage: str, status: int = 1) -> None:
        program, verb, *_ = command
        before = finished(stage)
        answer = here(*command)
        assert (answer.status, answer.out) == (status, ""), answer.err
        (line,) = answer.complaints
        assert line.startswith(f"{program} {verb}: error: ")
        assert words in line
        assert "internal error" not in line
        assert finished(stage) == before
        assert not list((folder / "runs/work").glob("*.outputs"))

    return check
