"""One command at work: its configuration, its run, and the stages that are done."""

import logging
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from geomotion.config import CommandConfig
from geomotion.errors import InvalidSetting, MissingRun
from geomotion.figures.studies.panels import DrawStudy
from geomotion.tracking import Artefacts, Stage, Tracker, store
from geomotion.tracking.tracker import CommandRun

WITHOUT_EFFECT = ("reuse", "output", "run", "study.jobs")  # on what a run computes
TRAINED_BY = "mlflow.source.name"  # tag with program and verb


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


@dataclass(frozen=True)
class Step:
    """A stage, what it needs, and what it takes from the command's configuration."""

    stage: Stage
    needs: tuple[str, ...]
    configure: Callable[["Session"], object]


@dataclass(frozen=True)
class Program:
    """What `gms` and `ncds` differ in.

    Attributes:
        name: Of the command.
        steps: Its stages by name, each after those it needs.
        verbs: What each verb does.
        execution_keys: Settings that may be given beside ``run=``, whose training is finished.
        check: Refuses a configuration that a late stage could not follow, before an early one has begun.
        study_figures: Pictures that its studies can draw.
    """

    name: str
    steps: Mapping[str, Step]
    verbs: Mapping[str, Callable[["Session"], VerbResult]]
    execution_keys: frozenset[str]
    check: Callable[[Any], None] = lambda config: None
    study_figures: Mapping[str, DrawStudy] = field(default_factory=dict)


@dataclass
class Session:
    """One command at work."""

    program: Program
    tracker: Tracker
    command: CommandRun
    config: Any
    reproduction: str  # the command line that makes the trained run again
    overrides: list[str]  # what was typed
    done: dict[str, Artefacts] = field(default_factory=dict)

    def produce(self, name: str) -> Artefacts:
        """The artefacts of a stage, after those of the stages it needs."""
        if name not in self.done:
            step = self.program.steps[name]
            inputs = {needed: self.produce(needed) for needed in step.needs}
            self.done[name] = self.tracker.run_stage(step.stage, step.configure(self), inputs, self.command)
        return self.done[name]

    def document(self, **content: Any) -> dict[str, Any]:
        """What every verb reports to programs, with the verb's own content."""
        stages = places(self.done)
        return {"command": self.command.name, "run_id": self.command.run_id, "stages": stages, **content}

    def beside(self, run: str) -> "Session":
        """A session on another trained run, under the same command."""
        return Session(self.program, self.tracker, self.command, self.config, "", [], _trained(self.tracker, run))


@contextmanager
def open_session(
    program: Program, verb: str, config: CommandConfig, overrides: list[str], parent: CommandRun | None = None
) -> Iterator[Session]:
    """A session whose run ends with the block, alone or as part of the run of a study.

    Raises:
        MissingRun: If ``run=`` or ``runs=`` names nothing that this program trained.
        InvalidSetting: If a setting beside ``run=`` would change its training.
        GeomotionError: If the program's own check refuses the configuration.
    """
    if config.run is not None:
        _refuse_training_overrides(program, config.run, overrides)
    program.check(config)
    wanted = [config.run] if config.run is not None else config.runs
    if wanted and not store.exists(config.tracking):
        raise MissingRun(
            wanted[0],
            f"there is no store in {config.tracking.root}/ yet. Train first: {program.name} train dataset=…",
        )
    tracker = Tracker(config.tracking, config.reuse, program.name)
    done = _trained(tracker, config.run) if config.run is not None else {}
    typed = overrides if config.run is None else _trained_with(tracker, config.run) + overrides
    kept = [item for item in typed if item.split("=")[0] not in WITHOUT_EFFECT]
    with tracker.command(f"{program.name} {verb}", config, overrides, parent) as command:
        tracker.link(command, done)
        reproduction = shlex.join([program.name, "run", *kept])
        yield Session(program, tracker, command, config, reproduction, overrides, done)


def places(done: Mapping[str, Artefacts]) -> dict[str, dict[str, str]]:
    """Run and folder of finished stages, for programs."""
    return {found.stage: {"run_id": found.run_id, "folder": str(found.folder)} for found in done.values()}


def log_to_standard_error() -> None:
    """Send what the library logs to standard error, as plain lines."""
    logger = logging.getLogger("geomotion")
    logger.setLevel(logging.INFO)
    logger.propagate = False
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("%(message)s"))
    logger.handlers = [handler]


def _trained(tracker: Tracker, run: str) -> dict[str, Artefacts]:
    lineage = tracker.lineage(run)
    if "train" not in lineage:
        raise MissingRun(run, f"it trained nothing. Name a run of `{tracker.program} train` or `{tracker.program} run`")
    trained_by = tracker.client.get_run(lineage["train"].run_id).data.tags.get(TRAINED_BY, tracker.program)
    if trained_by.split()[0] != tracker.program:
        raise MissingRun(
            run, f"it was trained by `{trained_by}`, whose models are others; use {trained_by.split()[0]} for it"
        )
    return {name: lineage[name] for name in ("ingest", "train")}


def _trained_with(tracker: Tracker, run: str) -> list[str]:
    return tracker.overrides(run)


def _refuse_training_overrides(program: Program, run: str, overrides: list[str]) -> None:
    for override in overrides:
        key = override.lstrip("+~").split("=")[0]
        if key.split(".")[0].split("/")[0] not in program.execution_keys:
            raise InvalidSetting(
                key, override.partition("=")[2], f"no such key beside run={run}, whose training is finished"
            )
