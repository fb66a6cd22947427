"""Runs of commands and stages: reuse of finished ones, resumption of stopped ones, look-up by name."""

import json
import logging
import shlex
import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlparse

from filelock import FileLock, Timeout

from geomotion.config import TrackingConfig, plain
from geomotion.errors import GeomotionError, Interrupted, MissingRun
from geomotion.files import temporary_prefix, write_json
from geomotion.tracking import store
from geomotion.tracking.artefacts import Artefacts, digest_of, environment, run_key
from geomotion.tracking.merging import OtherResults
from geomotion.tracking.stage import Stage, StageRun

logger = logging.getLogger("geomotion")

if TYPE_CHECKING:
    from mlflow import MlflowClient
    from mlflow.entities import Run

COMMAND, STAGE, KEY, DIGEST, ERROR = (f"geomotion.{name}" for name in ("command", "stage", "key", "digest", "error"))
OVERRIDES = "geomotion.overrides"
SAME = "geomotion.same_as"  # an older run whose artefacts stand for those of this one
MERGED = "geomotion.taken_over_from"  # run id in another results folder
INPUT = "geomotion.input."
MEMBER = "geomotion.stage."
PARENT = "mlflow.parentRunId"
POINTS_AT_ONCE = 500  # MLflow takes at most 1000
RESUMABLE = ("KILLED", "FAILED", "RUNNING")  # RUNNING: its process died without a word, or its lock would be held


@dataclass(frozen=True)
class CommandRun:
    """The MLflow run of one command; its stages are children, or older runs that were reused."""

    run_id: str
    name: str


class Tracker:
    """Everything that goes to MLflow goes through here.

    Args:
        config: Where runs are kept.
        reuse: Whether a finished stage with the same key is reused.
        program: Whose runs ``latest`` looks through: `gms` or `ncds`.

    Raises:
        StoreUnavailable: If the store cannot be opened.
    """

    def __init__(self, config: TrackingConfig, reuse: bool = True, program: str = "ncds") -> None:
        self.program = program
        self.uri = store.store_uri(config)
        self.reuse = reuse
        self.others = [OtherResults(root, config.experiment) for root in config.merge]
        self.work = Path(config.root).resolve() / "work"
        self.client: MlflowClient
        self.client, self.experiment_id = store.open_store(config)
        with store.store_errors(self.uri):
            self.work.mkdir(parents=True, exist_ok=True)

    @contextmanager
    def command(
        self, name: str, config: object, overrides: list[str], parent: CommandRun | None = None
    ) -> Iterator[CommandRun]:
        """The run of a whole command, alone or as part of another; failed or killed if the block raises."""
        tags = {COMMAND: name, OVERRIDES: shlex.join(overrides), "mlflow.source.name": name}
        if parent is not None:
            tags[PARENT] = parent.run_id
        tags["mlflow.note.content"] = f"`{shlex.join([*name.split(), *overrides])}`"
        run_id = self._create(name, tags)
        with store.store_errors(self.uri):
            self.client.log_dict(run_id, plain(config), "config.json")
            self.client.log_dict(run_id, environment(), "environment.json")
        with self._ending(run_id):
            yield CommandRun(run_id, name)

    def run_stage(self, stage: Stage, config: object, inputs: Mapping[str, Artefacts], parent: CommandRun) -> Artefacts:
        """Run a stage, or reuse a finished run with the same key, or continue a stopped one.

        Two processes that need the same stage do not compute it twice: the second waits for the first.

        Raises:
            CorruptArtefact: If an input is not what was written.
        """
        for artefacts in inputs.values():
            artefacts.verify()
        key = run_key(stage.name, config, inputs)
        with self._computing(stage.name, key):
            may_be_known = self.reuse and not stage.reads_outside
            found = self._finished(key) if may_be_known else None
            if found is not None:
                logger.info("%s: reused run %s", stage.name, found.run_id[:8])
            elif may_be_known:
                found = self._taken_over(stage, config, inputs, parent, key)
            if found is None:
                begun = time.monotonic()
                found = self._execute(stage, config, inputs, parent, key)
                logger.info("%s: done in %.1f s", stage.name, time.monotonic() - begun)
        self.link(parent, {stage.name: found})
        return found

    @contextmanager
    def _computing(self, stage: str, key: str) -> Iterator[None]:
        """Nobody else computes this key meanwhile."""
        lock = FileLock(self.work / f"{key}.lock")
        try:
            lock.acquire(blocking=False)
        except Timeout:
            logger.info("%s: waiting for another command that computes the same", stage)
            lock.acquire()
        try:
            yield
        finally:
            lock.release()

    def link(self, command: CommandRun, stages: Mapping[str, Artefacts]) -> None:
        """Note that finished stages belong to a command."""
        with store.store_errors(self.uri):
            for name, found in stages.items():
                self.client.set_tag(command.run_id, MEMBER + name, found.run_id)

    def log_document(self, command: CommandRun, name: str, document: dict[str, Any]) -> None:
        """Keep a JSON document with the run of a command."""
        with store.store_errors(self.uri):
            self.client.log_dict(command.run_id, document, name)

    def _execute(
        self, stage: Stage, config: object, inputs: Mapping[str, Artefacts], parent: CommandRun, key: str
    ) -> Artefacts:
        checkpoint = self._checkpoint(key)
        if not self.reuse:
            self._discard(checkpoint)
        run_id = self._stopped(key) if any(self._kept(checkpoint)) else None
        if run_id is None:
            run_id = self._begin(stage, config, inputs, parent, key)
        with self._ending(run_id), self._scratch(key) as folder:
            run = StageRun(folder, checkpoint, self.client, run_id)
            write_json(run.folder / "config.json", plain(config))
            write_json(run.folder / "environment.json", environment())
            with run.flushed():
                stage.function(config, inputs, run)
            digest = digest_of(run.folder)
            same = self._finished(key, digest) if self.reuse and stage.reads_outside else None
            if same is not None:
                self.client.set_tag(run_id, SAME, same.run_id)
                return same
            with store.store_errors(self.uri):
                self.client.log_artifacts(run_id, str(folder))
                self.client.set_tag(run_id, DIGEST, digest)
        self._discard(checkpoint)
        return self._artefacts(self.client.get_run(run_id))

    def _begin(
        self, stage: Stage, config: object, inputs: Mapping[str, Artefacts], parent: CommandRun, key: str
    ) -> str:
        tags = {STAGE: stage.name, KEY: key, PARENT: parent.run_id, "mlflow.source.name": parent.name}
        run_id = self._create(stage.name, tags | {INPUT + name: found.run_id for name, found in inputs.items()})
        self._log_parameters(run_id, config)
        return run_id

    def _taken_over(
        self, stage: Stage, config: object, inputs: Mapping[str, Artefacts], parent: CommandRun, key: str
    ) -> Artefacts | None:
        """A copy of the same computation from another results folder, with all that it logged."""
        other = next((found for one in self.others if (found := one.finished(key, KEY, DIGEST)) is not None), None)
        if other is None:
            return None
        run_id = self._begin(stage, config, inputs, parent, key)
        with self._ending(run_id), store.store_errors(self.uri):
            for first in range(0, len(other.curves), POINTS_AT_ONCE):
                self.client.log_batch(run_id, metrics=other.curves[first : first + POINTS_AT_ONCE])
            self.client.log_artifacts(run_id, str(other.folder))
            self.client.set_tag(run_id, MERGED, other.run.info.run_id)
            self.client.set_tag(run_id, DIGEST, other.run.data.tags[DIGEST])
        self._discard(self._checkpoint(key))  # of a run that stopped here
        logger.info("%s: taken over from run %s", stage.name, other.run.info.run_id[:8])
        return self._artefacts(self.client.get_run(run_id))

    def _checkpoint(self, key: str) -> Path:
        return self.work / f"{key}.checkpoint"

    def _kept(self, checkpoint: Path) -> list[Path]:
        """A checkpoint and those beside it of a training in several phases."""
        return list(self.work.glob(f"{checkpoint.name}*"))

    def _discard(self, checkpoint: Path) -> None:
        killed_while_written = self.work.glob(f"{temporary_prefix(checkpoint)}*")
        for path in [*self._kept(checkpoint), *killed_while_written]:
            path.unlink(missing_ok=True)

    @contextmanager
    def _scratch(self, key: str) -> Iterator[Path]:
        """An empty folder for the outputs of a stage; what a killed process left there is removed first."""
        folder = self.work / f"{key}.outputs"
        shutil.rmtree(folder, ignore_errors=True)
        try:
            folder.mkdir()
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    # ------------------------------------------------------------ looking runs up
    def lineage(self, run: str) -> dict[str, Artefacts]:
        """The finished stages behind a run, by stage name.

        Args:
            run: ``latest`` (the newest command with a trained model), a run id or the beginning of one, or a
                path inside the artefacts of a run.

        Raises:
            MissingRun: If there is no such run.
        """
        found = self._resolve(run)
        stages = {
            name.removeprefix(MEMBER): run_id for name, run_id in found.data.tags.items() if name.startswith(MEMBER)
        }
        if found.data.tags.get(STAGE):
            stages[found.data.tags[STAGE]] = found.info.run_id
        artefacts: dict[str, Artefacts] = {}
        while stages:
            name, run_id = stages.popitem()
            member = self.client.get_run(run_id)
            if SAME in member.data.tags:
                member = self.client.get_run(member.data.tags[SAME])
            if member.info.status != "FINISHED":
                raise MissingRun(run, f"its stage {name!r} is {member.info.status.lower()}, not finished")
            if DIGEST not in member.data.tags:
                raise MissingRun(run, f"its stage {name!r} left no artefacts")
            artefacts[name] = self._artefacts(member)
            for tag, source in member.data.tags.items():
                if tag.startswith(INPUT) and tag.removeprefix(INPUT) not in artefacts:
                    stages[tag.removeprefix(INPUT)] = source
        return artefacts

    def overrides(self, run: str) -> list[str]:
        """What was typed after the verb of the command that a run belongs to."""
        tags = self._resolve(run).data.tags
        if COMMAND not in tags and PARENT in tags:  # a stage
            tags = self.client.get_run(tags[PARENT]).data.tags
        return shlex.split(tags.get(OVERRIDES, ""))

    def _resolve(self, run: str) -> "Run":
        if run == "latest":
            runs = [
                found
                for found in self._search(f"tags.`{COMMAND}` LIKE '{self.program} %'")
                if MEMBER + "train" in found.data.tags
            ]
            if not runs:
                raise MissingRun(
                    run, f"no finished training in the store yet. Train one first: {self.program} train dataset=…"
                )
            return runs[0]
        identity = run
        if "/" in run or Path(run).exists():
            parts = [
                part for part in Path(run).resolve().parts if len(part) == 32 and set(part) <= set("0123456789abcdef")
            ]
            if not parts:
                raise MissingRun(run, "this path is not inside the artefacts of a run (expected …/<run id>/artifacts)")
            identity = parts[-1]
        runs = (
            [found for found in self._search("") if found.info.run_id.startswith(identity)]
            if len(identity) >= 4
            else []
        )
        if not runs:
            raise MissingRun(
                run, f"no such run in the store. `{self.program} ui` shows the runs; run=latest takes the newest"
            )
        if len(runs) > 1:
            raise MissingRun(run, f"{len(runs)} runs begin like this; give more characters of the run id")
        return runs[0]

    def _search(self, condition: str) -> list["Run"]:
        with store.store_errors(self.uri):
            return list(
                self.client.search_runs([self.experiment_id], condition, max_results=5000, order_by=["start_time DESC"])
            )

    def _finished(self, key: str, digest: str | None = None) -> Artefacts | None:
        condition = f"tags.`{KEY}` = '{key}' AND status = 'FINISHED'"
        if digest is not None:
            condition += f" AND tags.`{DIGEST}` = '{digest}'"
        for run in self._search(condition):
            if DIGEST in run.data.tags:
                artefacts = self._artefacts(run)
                if artefacts.folder.is_dir() and digest_of(artefacts.folder) == artefacts.digest:
                    return artefacts
        return None

    def _stopped(self, key: str) -> str | None:
        for run in self._search(f"tags.`{KEY}` = '{key}'"):
            if run.info.status in RESUMABLE:
                with store.store_errors(self.uri):
                    self.client.update_run(run.info.run_id, status="RUNNING")
                return str(run.info.run_id)
        return None

    def _artefacts(self, run: "Run") -> Artefacts:
        location = urlparse(run.info.artifact_uri)
        if location.scheme in ("", "file"):
            folder = Path(unquote(location.path))
        else:
            with store.store_errors(self.uri):
                folder = Path(self.client.download_artifacts(run.info.run_id, "", str(self._download_folder(run))))
        return Artefacts(run.data.tags[STAGE], run.info.run_id, folder, run.data.tags[DIGEST], self.program)

    def _download_folder(self, run: "Run") -> Path:
        folder = self.work / "downloads" / str(run.info.run_id)
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        return folder

    # ------------------------------------------------------------ writing
    def _create(self, name: str, tags: Mapping[str, str]) -> str:
        with store.store_errors(self.uri):
            return str(self.client.create_run(self.experiment_id, run_name=name, tags=dict(tags)).info.run_id)

    def _log_parameters(self, run_id: str, config: object) -> None:
        from mlflow.entities import Param

        with store.store_errors(self.uri):
            parameters = [Param(name, value[:500]) for name, value in flatten(plain(config)).items()]
            self.client.log_batch(run_id, params=parameters[:100])

    @contextmanager
    def _ending(self, run_id: str) -> Iterator[None]:
        """End the run with the status that the block deserves."""
        status = "FINISHED"
        try:
            yield
        except BaseException as error:
            status = "KILLED" if isinstance(error, Interrupted | KeyboardInterrupt) else "FAILED"
            self._note_error(run_id, error)
            raise
        finally:
            self._terminate(run_id, status)

    def _note_error(self, run_id: str, error: BaseException) -> None:
        message = str(error) if isinstance(error, GeomotionError) else f"{type(error).__name__}: {error}"
        try:
            self.client.set_tag(run_id, ERROR, message[:5000])
        except Exception:  # the first error is the one to report, not that the store did not take its note
            return

    def _terminate(self, run_id: str, status: str) -> None:
        try:
            self.client.set_terminated(run_id, status=status)
        except Exception:
            if status == "FINISHED":
                raise


def flatten(document: Any, prefix: str = "") -> dict[str, str]:
    """Nested mappings as dotted names with text values."""
    if not isinstance(document, Mapping):
        return {prefix: json.dumps(document) if not isinstance(document, str) else document}
    flat: dict[str, str] = {}
    for name, value in document.items():
        flat |= flatten(value, f"{prefix}.{name}" if prefix else str(name))
    return flat
