"""Commands run in this process, with a stand-in for the pipeline."""

import ctypes
import logging
import os
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace

import pytest

from geomotion_cli.dispatch import main


@dataclass
class Answer:
    """What a command left behind."""

    status: int
    out: str
    err: str


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
