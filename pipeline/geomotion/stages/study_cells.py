"""The cells of a study: one variant on one dataset with one seed, each an ordinary run of the program."""

import logging
import multiprocessing
import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from itertools import product

from hydra import compose
from omegaconf import OmegaConf

from geomotion.config import CommandConfig, StudyConfig
from geomotion.errors import GeomotionError, Interrupted, InvalidSetting
from geomotion.interrupts import interrupts_as_errors
from geomotion.stages.programs import program_of
from geomotion.stages.session import log_to_standard_error, open_session
from geomotion.tracking import Artefacts
from geomotion.tracking.tracker import CommandRun

logger = logging.getLogger("geomotion")

OF_THE_STUDY = ("study", "output", "run", "runs")  # settings that a cell does not share
NO_STUDY = ("study.variants=[]", "study.datasets=[]")
BUDGET = ("training.", "evaluation.")  # what may be changed for all variants, though some of them set it as well


@dataclass(frozen=True)
class Cell:
    """One run of a study.

    Attributes:
        variant: Label of what is compared.
        dataset: Choice of the dataset.
        seed: Seed.
        overrides: Settings that make this run, as on the command line.
    """

    variant: str
    dataset: str
    seed: int
    overrides: list[str]

    @property
    def name(self) -> str:
        """For people."""
        return f"{self.variant}, {self.dataset}, seed {self.seed}"


@dataclass(frozen=True)
class ComposedCell:
    """A cell with its settings composed."""

    cell: Cell
    config: CommandConfig


@dataclass(frozen=True)
class Outcome:
    """What became of a cell: the stages that are done, or why it failed."""

    cell: Cell
    done: Mapping[str, Artefacts]
    failure: str | None = None


def compose_cells(program: str, study: StudyConfig, typed: Sequence[str]) -> list[ComposedCell]:
    """Every cell with its settings: those of its variant, then those that were typed beside the study.

    Raises:
        InvalidSetting: If something is typed that the study itself varies.
        HydraException: If settings do not fit a cell.
    """
    shared = [item for item in typed if _key(item).partition(".")[0] not in OF_THE_STUDY]
    _refuse_varied(study, shared)
    cells = []
    for dataset, variant, seed in product(study.datasets, study.variants, study.seeds):
        overrides = [*variant.overrides, *shared, f"dataset={dataset}", f"seed={seed}", *NO_STUDY]
        config = OmegaConf.to_object(compose(program, overrides=overrides))
        assert isinstance(config, CommandConfig)
        program_of(config).check(config)
        cells.append(ComposedCell(Cell(variant.label, dataset, seed, overrides), config))
    return cells


def run_cells(cells: Sequence[ComposedCell], study: CommandRun, jobs: int) -> Iterator[Outcome]:
    """Outcomes in the order in which cells end; finished stages of earlier runs are reused.

    Raises:
        Interrupted: If a signal arrived; cells in other processes are stopped as well.
    """
    if jobs == 1:
        yield from (run_cell(cell, study) for cell in cells)
        return
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), _prepare_process) as pool:
        futures = [pool.submit(_run_cell_apart, cell, study) for cell in cells]
        try:
            yield from (future.result() for future in as_completed(futures))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                process.terminate()
            raise


def run_cell(composed: ComposedCell, study: CommandRun) -> Outcome:
    """Run the stages of a cell up to its scores; a failure is an outcome like any other."""
    cell, program = composed.cell, program_of(composed.config)
    try:
        with open_session(program, "eval", composed.config, cell.overrides, study) as session:
            session.produce("evaluate")
    except Interrupted:
        raise
    except GeomotionError as error:
        return Outcome(cell, {}, str(error))
    except Exception as error:  # a mistake of ours in one cell must not cost the others
        logger.exception("study: %s failed", cell.name)
        return Outcome(cell, {}, f"internal error: {type(error).__name__}: {error}")
    return Outcome(cell, session.done)


def _prepare_process() -> None:
    import torch

    log_to_standard_error()
    torch.set_num_threads(1)


def _run_cell_apart(cell: ComposedCell, study: CommandRun) -> Outcome:
    try:
        with interrupts_as_errors():
            return run_cell(cell, study)
    except Interrupted as stop:
        os._exit(stop.exit_code)  # or the pool would hand this process its next cell


def _refuse_varied(study: StudyConfig, typed: Sequence[str]) -> None:
    varied = {_key(item) for variant in study.variants for item in variant.overrides}
    for item in typed:
        key, value = _key(item), item.partition("=")[2]
        if key in ("dataset", "seed"):
            raise InvalidSetting(key, value, f"study.{key}s=[…] beside a study, which runs on each of them")
        if key in varied and not key.startswith(BUDGET):
            raise InvalidSetting(key, value, "no such setting here, because the variants of the study differ in it")


def _key(override: str) -> str:
    return override.lstrip("+~").partition("=")[0]
