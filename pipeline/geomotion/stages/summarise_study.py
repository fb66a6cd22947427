"""Stage ``study``: scores of many runs in, one table, its pictures and one page out."""

import csv
import io
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from geomotion.config import StudyConfig
from geomotion.figures.report.page import Column, Listing
from geomotion.figures.report.pictures import Picture, pictures
from geomotion.figures.report.study_page import StudyPage, render_study
from geomotion.figures.studies.panels import DrawStudy, JudgedCell, StudyFigure
from geomotion.figures.style import save_figure
from geomotion.files import atomic, read_json, write_json, write_text
from geomotion.stages.initial_conditions import initial_conditions
from geomotion.stages.study_cells import Cell
from geomotion.stages.study_table import legend, lines, markdown_table, reference_values, table_document
from geomotion.tracking import Artefacts, StageRun

Document = Mapping[str, Any]
TEXT_COLUMNS = 2  # dataset and variant


@dataclass(frozen=True)
class CellRecord:
    """What is kept of a cell and its outcome.

    Attributes:
        cell: The run.
        run_id: MLflow run of its evaluation; None where it failed.
        failure: Why it failed, if it did.
    """

    cell: Cell
    run_id: str | None
    failure: str | None


@dataclass(frozen=True)
class StudyStageConfig:
    """What the stage needs beyond the evaluations.

    Attributes:
        study: Rows, columns, references, figures.
        cells: All cells, in order; those that did not fail have the input ``evaluate_<number>``.
        command: Command line that repeats the study.
    """

    study: StudyConfig
    cells: list[CellRecord]
    command: str


def summarise_study(
    config: StudyStageConfig, inputs: Mapping[str, Artefacts], run: StageRun, draw: Mapping[str, DrawStudy]
) -> None:
    """Write ``table.json``, ``table.csv``, ``table.md``, ``initial_conditions.npz``, the figures and ``report.html``.

    Args:
        config: The study and its cells.
        inputs: Their evaluations.
        run: Where to write.
        draw: Figures by name.

    Raises:
        MissingArtefact: If an evaluation left no scores.
    """
    study = config.study
    evaluations = [inputs.get(f"evaluate_{number}") for number in range(len(config.cells))]
    judged = [(one.cell, found) for one, found in zip(config.cells, evaluations, strict=True) if found is not None]
    scores = [(cell, read_json(found.path("scores.json"))["scores"]) for cell, found in judged]
    by_row: dict[tuple[str, str], list[Document]] = {}
    for cell, own in scores:
        by_row.setdefault((cell.dataset, cell.variant), []).append(own)
    starts, differing = initial_conditions([(cell, found.folder) for cell, found in judged])
    failures = [f"{one.cell.name}: {one.failure}" for one in config.cells if one.failure is not None]
    table = table_document(replace(study, notes=[*study.notes, *differing]), by_row, failures)
    with atomic(run.folder / "initial_conditions.npz") as temporary:
        np.savez_compressed(temporary, allow_pickle=False, **starts)
    write_json(run.folder / "table.json", table)
    write_text(run.folder / "table.csv", _csv(study, scores))
    write_text(run.folder / "table.md", markdown_table(table))

    cells = [JudgedCell(cell.dataset, cell.variant, cell.seed, found.folder) for cell, found in judged]
    drawn: dict[str, StudyFigure] = {}
    for name in study.figures:
        if cells and (figure := draw[name](cells)) is not None:
            drawn[name] = figure
            save_figure(figure.figure, run.folder / "figures", name, figure.data)
    captions = {name: (one.title, one.caption) for name, one in drawn.items()}
    shown = pictures([run.folder / "figures"], captions)
    write_text(run.folder / "report.html", render_study(_page(config, table, list(shown.values()))))


def _csv(study: StudyConfig, scores: Sequence[tuple[Cell, Document]]) -> str:
    """One row for each cell, unrounded; a score that is missing or not finite is empty."""
    names, reference = [column.score for column in study.columns], study.reference
    others = [f"{reference.source}: {name}" for name in reference.columns] if reference else []
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(["dataset", "variant", "seed", *names, *others])
    for cell, own in scores:
        values = [own[name]["value"] if name in own else None for name in names]
        theirs: Sequence[float | None] = reference_values(reference, cell.dataset, cell.variant) or [None] * len(others)
        writer.writerow([cell.dataset, cell.variant, cell.seed, *values, *theirs])
    return buffer.getvalue()


def _page(config: StudyStageConfig, table: Document, shown: Sequence[Picture]) -> StudyPage:
    head, *rows = lines(table)
    columns = tuple(Column(name, is_text=number < TEXT_COLUMNS) for number, name in enumerate(head))
    runs = tuple(
        (one.cell.name, one.run_id or "failed", one.failure or shlex.join(one.cell.overrides)) for one in config.cells
    )
    names = (Column("run", is_text=True), Column("evaluation", is_text=True), Column("settings", is_text=True))
    return StudyPage(
        title=config.study.title,
        table=Listing("Table", columns, tuple(map(tuple, rows))),
        legend=legend(table),
        notes=list(table["notes"]),
        failures=list(table["failures"]),
        pictures=list(shown),
        runs=Listing("Runs", names, runs),
        command=config.command,
    )
