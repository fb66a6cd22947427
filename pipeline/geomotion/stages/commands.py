"""Where the command line meets the pipeline: one function that carries out any verb of any program."""

import os
import sys

import torch

from geomotion.config import CommandConfig
from geomotion.errors import MissingRun
from geomotion.interrupts import interrupts_as_errors
from geomotion.stages.programs import program_of
from geomotion.stages.session import VerbResult, log_to_standard_error, open_session
from geomotion.stages.studies import run_study
from geomotion.tracking import store

__all__ = ["VerbResult", "run_verb"]


def run_verb(verb: str, config: CommandConfig, overrides: list[str]) -> VerbResult:
    """Run one verb of the program whose configuration this is.

    Raises:
        GeomotionError: For everything that the user can mend.
    """
    program = program_of(config)
    log_to_standard_error()
    torch.set_num_threads(1)  # the networks are small: a second thread costs up to twenty times what it gives
    if verb == "ui":
        return _ui(config, program.name)
    with (
        interrupts_as_errors(),
        store.database_errors(store.store_uri(config.tracking)),
        open_session(program, verb, config, overrides) as session,
    ):
        return program.verbs[verb](session) if not config.study.variants else run_study(session, verb)


def _ui(config: CommandConfig, program: str) -> VerbResult:
    if not store.exists(config.tracking):
        raise MissingRun("latest", f"there is no store in {config.tracking.root}/ yet. Make one with: {program} run")
    uri, port = store.store_uri(config.tracking), config.tracking.ui_port
    print(f"MLflow on {uri}: open http://127.0.0.1:{port}/#/experiments (Ctrl-C ends it)", file=sys.stderr, flush=True)
    options = [f"--backend-store-uri={uri}", "--host=127.0.0.1", f"--port={port}", "--workers=1"]
    os.execv(sys.executable, [sys.executable, "-m", "mlflow", "ui", *options])
