"""A study: many runs of a program, and one table of their scores beside those of others."""

import logging
from dataclasses import replace
from functools import partial
from typing import Any

from geomotion.errors import InvalidSetting, UnknownName
from geomotion.files import read_json
from geomotion.stages.session import Session, VerbResult, places
from geomotion.stages.study_cells import Outcome, compose_cells, run_cells
from geomotion.stages.study_table import aligned_table
from geomotion.stages.summarise_study import CellRecord, StudyStageConfig, summarise_study
from geomotion.tracking import Stage

logger = logging.getLogger("geomotion")


def run_study(session: Session, verb: str) -> VerbResult:
    """Run every cell, then gather them; exit status 1 if one failed.

    Raises:
        InvalidSetting: If the study is not valid, or the verb is another one than ``run`` or ``compare``.
        UnknownName: If a figure is asked for that this program does not draw.
    """
    study, program = session.config.study, session.program
    if verb not in ("run", "compare") or session.config.run is not None or session.config.runs:
        expected = f"no study here: they begin anew, with `{program.name} compare` or `run`"
        raise InvalidSetting("study.title", study.title, expected)
    for figure in study.figures:
        if figure not in program.study_figures:
            raise UnknownName("study figure", figure, program.study_figures)
    cells = compose_cells(program.name, study, session.overrides)
    if study.shards > len(cells):
        raise InvalidSetting("study.shards", study.shards, f"{len(cells)} at most, the number of cells")
    if study.shard is not None:
        cells = cells[study.shard :: study.shards]
    outcomes: dict[str, Outcome] = {}
    for outcome in run_cells(cells, session.command, study.jobs):
        outcomes[outcome.cell.name] = outcome
        state = "done" if outcome.failure is None else f"failed: {outcome.failure}"
        logger.info("study: %d of %d, %s: %s", len(outcomes), len(cells), outcome.cell.name, state)

    ordered = [outcomes[composed.cell.name] for composed in cells]
    config = StudyStageConfig(
        replace(study, jobs=1, shards=1, shard=None), [_record(one) for one in ordered], session.reproduction
    )
    inputs = {f"evaluate_{n}": one.done["evaluate"] for n, one in enumerate(ordered) if one.failure is None}
    stage = Stage("study", partial(summarise_study, draw=program.study_figures))
    found = session.tracker.run_stage(stage, config, inputs, session.command)
    session.done["study"] = found
    table = read_json(found.path("table.json"))
    text = f"{aligned_table(table)}\n\ntable   {found.path('table.csv')}\nreport  {found.path('report.html')}"
    document = session.document(study=table, cells=[_cell_document(one) for one in ordered])
    return VerbResult(text, document, exit_code=1 if table["failures"] else 0)


def _cell_document(outcome: Outcome) -> dict[str, Any]:
    cell = outcome.cell
    varied = {"variant": cell.variant, "dataset": cell.dataset, "seed": cell.seed}
    return {**varied, "failure": outcome.failure, "stages": places(outcome.done)}


def _record(outcome: Outcome) -> CellRecord:
    run_id = outcome.done["evaluate"].run_id if outcome.failure is None else None
    return CellRecord(outcome.cell, run_id, outcome.failure)
