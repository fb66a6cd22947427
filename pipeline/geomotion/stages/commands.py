"""The verbs of the command line as chains of stages; knows nothing of argument parsing."""

import logging
import os
import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import torch

from geomotion.config import DatasetConfig, GmsConfig, NcdsConfig
from geomotion.errors import InvalidSetting, MissingRun
from geomotion.files import read_json
from geomotion.interrupts import interrupts_as_errors
from geomotion.models import ModelConfig
from geomotion.stages import compare, regression
from geomotion.stages.evaluate import EvaluateConfig, evaluate, scores_table
from geomotion.stages.export import ExportConfig, export
from geomotion.stages.ingest import ingest, summary_table
from geomotion.stages.report import ReportConfig, report
from geomotion.stages.rollout import RolloutStageConfig, rollout, rollout_table
from geomotion.stages.train import TrainConfig, train
from geomotion.tracking import Artefacts, Stage, Tracker, store
from geomotion.tracking.tracker import CommandRun

EXECUTION_KEYS = (
    "evaluation",
    "solver",
    "obstacle",
    "rollout",
    "tracking",
    "output",
    "reuse",
    "run",
    "runs",
    "check",
    "hydra",
)


@dataclass(frozen=True)
class VerbResult:
    """What a verb tells its caller.

    Attributes:
        text: For people, on standard output.
        document: For programs (``output=json``).
        exit_code: Exit status of the process.
        objective: Number that a parameter sweep may minimise.
    """

    text: str
    document: dict[str, Any] = field(default_factory=dict)
    exit_code: int = 0
    objective: float | None = None


def run_verb(verb: str, config: GmsConfig, overrides: list[str]) -> VerbResult:
    """Run one verb of ``ncds``, or of ``gms``, whose configuration has no field.

    Raises:
        GeomotionError: For everything that the user can mend.
    """
    program = "ncds" if isinstance(config, NcdsConfig) else "gms"
    _log_to_standard_error()
    torch.set_num_threads(1)  # the networks are small: a second thread costs up to twenty times what it gives
    if verb == "ui":
        return _ui(config)
    with (
        interrupts_as_errors(),
        store.database_errors(store.store_uri(config.tracking)),
        _session(f"{program} {verb}", config, overrides) as session,
    ):
        return VERBS[verb](session)


# ---------------------------------------------------------------- sessions
@dataclass
class Session:
    """One command at work: its configuration, its run, and the stages that are done."""

    tracker: Tracker
    command: CommandRun
    config: Any
    reproduction: str  # the command line that makes the trained run again
    done: dict[str, Artefacts] = field(default_factory=dict)

    def produce(self, name: str) -> Artefacts:
        """The artefacts of a stage, after those of the stages it needs."""
        if name not in self.done:
            step = STEPS[name]
            inputs = {needed: self.produce(needed) for needed in step.needs}
            self.done[name] = self.tracker.run_stage(step.stage, step.configure(self), inputs, self.command)
        return self.done[name]

    def document(self, **content: Any) -> dict[str, Any]:
        """What every verb reports to programs, with the verb's own content."""
        stages = {name: {"run_id": found.run_id, "folder": str(found.folder)} for name, found in self.done.items()}
        return {"command": self.command.name, "run_id": self.command.run_id, "stages": stages, **content}


@contextmanager
def _session(name: str, config: GmsConfig, overrides: list[str]) -> Iterator[Session]:
    run = getattr(config, "run", None)
    if run is not None:
        _refuse_training_overrides(run, overrides)
    wanted = [run] if run is not None else getattr(config, "runs", [])
    if wanted and not store.exists(config.tracking):
        raise MissingRun(
            wanted[0], f"there is no store in {config.tracking.root}/ yet. Train first: ncds train dataset=…"
        )
    tracker = Tracker(config.tracking, config.reuse)
    done = _trained(tracker, run) if run is not None else {}
    typed = overrides if run is None else tracker.overrides(run)
    reproduction = shlex.join(
        ["ncds", "run", *(item for item in typed if item.split("=")[0] not in ("reuse", "output"))]
    )
    with tracker.command(name, config, overrides) as command:
        tracker.link(command, done)
        yield Session(tracker, command, config, reproduction, done)


def _trained(tracker: Tracker, run: str) -> dict[str, Artefacts]:
    lineage = tracker.lineage(run)
    if "train" not in lineage:
        raise MissingRun(run, "it trained nothing. Name a run of `ncds train` or `ncds run`")
    return {name: lineage[name] for name in ("ingest", "train")}


def _refuse_training_overrides(run: str, overrides: list[str]) -> None:
    for override in overrides:
        key = override.lstrip("+~").split("=")[0]
        if key.split(".")[0].split("/")[0] not in EXECUTION_KEYS:
            raise InvalidSetting(
                key, override.partition("=")[2], f"no such key beside run={run}, whose training is finished"
            )


def _log_to_standard_error() -> None:
    logger = logging.getLogger("geomotion")
    logger.setLevel(logging.INFO)
    logger.propagate = False
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("%(message)s"))
    logger.handlers = [handler]


# ---------------------------------------------------------------- stages and their configuration
@dataclass(frozen=True)
class Step:
    """A stage, what it needs, and what it takes from the command's configuration."""

    stage: Stage
    needs: tuple[str, ...]
    configure: Callable[["Session"], object]


def _train_config(session: Session) -> TrainConfig:
    config: NcdsConfig = session.config
    dataset = config.dataset
    return TrainConfig(
        # the base class: where recordings come from must not decide whether a training is repeated
        selection=DatasetConfig(dataset.name, dataset.state_channels, dataset.train_demos, dataset.test_demos),
        model=ModelConfig(config.chart, config.field, config.regulariser, config.seed),
        training=config.training,
        seed=config.seed,
    )


def _rollout_config(session: Session) -> RolloutStageConfig:
    return RolloutStageConfig(session.config.rollout, session.config.solver, session.config.obstacle)


def _evaluate_config(session: Session) -> EvaluateConfig:
    return EvaluateConfig(session.config.evaluation, session.config.solver)


def _export_config(session: Session) -> ExportConfig:
    return ExportConfig(session.config.tracking.register_as)


def _report_config(session: Session) -> ReportConfig:
    return ReportConfig(command=session.reproduction)


STEPS: dict[str, Step] = {
    "ingest": Step(Stage("ingest", ingest, reads_outside=True), (), lambda session: session.config.dataset),
    "train": Step(Stage("train", train), ("ingest",), _train_config),
    "rollout": Step(Stage("rollout", rollout), ("ingest", "train"), _rollout_config),
    "evaluate": Step(Stage("evaluate", evaluate), ("ingest", "train"), _evaluate_config),
    "export": Step(Stage("export", export), ("train",), _export_config),
    "report": Step(Stage("report", report), ("ingest", "train", "rollout", "evaluate", "export"), _report_config),
}


# ---------------------------------------------------------------- verbs
def _ingest(session: Session) -> VerbResult:
    found = session.produce("ingest")
    summary = read_json(found.path("summary.json"))
    text = f"{summary_table(summary)}\n\npicture  {found.path('figures/demonstrations.png')}\ndata     {found.folder}"
    return VerbResult(text, session.document(summary=summary))


def _train(session: Session) -> VerbResult:
    found = session.produce("train")
    certificate = read_json(found.path("certificate.json"))
    text = f"{_certificate_line(certificate)}\nmodel  {found.path('model.pt')}\nnext   ncds eval run={found.run_id[:8]}"
    return VerbResult(text, session.document(certificate=certificate))


def _rollout(session: Session) -> VerbResult:
    found = session.produce("rollout")
    rollouts = read_json(found.path("rollouts.json"))
    text = f"{rollout_table(rollouts)}\n\ntrajectories  {found.path('rollouts')}"
    return VerbResult(text, session.document(rollouts=rollouts))


def _evaluate(session: Session) -> VerbResult:
    found = session.produce("evaluate")
    scores = read_json(found.path("scores.json"))
    certificate = read_json(found.path("certificate.json"))
    text = f"{scores_table(scores)}\n\n{_certificate_line(certificate)}\nscores  {found.path('scores.json')}"
    return VerbResult(
        text, session.document(scores=scores, certificate=certificate), objective=compare.objective(scores)
    )


def _report(session: Session) -> VerbResult:
    path = str(session.produce("report").path("report.html"))
    return VerbResult(f"report  {path}", session.document(report=path))


def _run(session: Session) -> VerbResult:
    _, evaluated, reported = session.produce("rollout"), _evaluate(session), _report(session)
    document = evaluated.document | reported.document
    return VerbResult(f"{evaluated.text}\n{reported.text}", document, objective=evaluated.objective)


def _compare(session: Session) -> VerbResult:
    runs: list[str] = session.config.runs
    if len(runs) < 2:
        raise InvalidSetting("runs", runs, "two or more trained runs, for example runs=[latest,1a2b3c4d]")
    documents = {}
    for run in runs:
        one = Session(session.tracker, session.command, session.config, "", _trained(session.tracker, run))
        documents[run] = read_json(one.produce("evaluate").path("scores.json"))
    comparison = compare.comparison(documents)
    session.tracker.log_document(session.command, "scores.json", comparison)
    return VerbResult(compare.comparison_table(comparison), session.document(comparison=comparison))


def _check(session: Session) -> VerbResult:
    scores = read_json(session.produce("evaluate").path("scores.json"))
    verdict = regression.check(session.config.check, scores)
    session.tracker.log_document(session.command, "scores.json", verdict.document)
    return VerbResult(verdict.text, session.document(**verdict.document), exit_code=0 if verdict.passed else 1)


def _ui(config: GmsConfig) -> VerbResult:
    if not store.exists(config.tracking):
        raise MissingRun("latest", f"there is no store in {config.tracking.root}/ yet. Make one with: ncds run")
    uri, port = store.store_uri(config.tracking), config.tracking.ui_port
    print(f"MLflow on {uri}: open http://127.0.0.1:{port}/#/experiments (Ctrl-C ends it)", file=sys.stderr, flush=True)
    options = [f"--backend-store-uri={uri}", "--host=127.0.0.1", f"--port={port}", "--workers=1"]
    os.execv(sys.executable, [sys.executable, "-m", "mlflow", "ui", *options])


def _certificate_line(certificate: dict[str, Any]) -> str:
    rate = certificate["rate_per_s"]
    proven = f" at {rate:.3g} 1/s" if rate is not None else ""
    return f"contraction  {certificate['claim'].replace('_', ' ')}{proven}; metric: {certificate['metric']}"


VERBS: dict[str, Callable[[Session], VerbResult]] = {
    "ingest": _ingest,
    "train": _train,
    "rollout": _rollout,
    "eval": _evaluate,
    "report": _report,
    "run": _run,
    "compare": _compare,
    "check": _check,
}
