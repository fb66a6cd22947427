"""Scores as rows of tables, each beside what it has to be compared with."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from geomotion.scores.table import TITLES

Scores = Mapping[str, Mapping[str, Any]]
CENTRAL = ("mean", "pooled")  # statistics that lie in the middle of their values
SETS = {"train": "training", "heldout": "held out"}


@dataclass(frozen=True)
class Subject:
    """What the scores of a program are about.

    Attributes:
        title: Of the table with training and held-out columns.
        order: Its rows; under each score, the baselines that it has to beat.
        labels: Names for people, of scores and of groups of them.
    """

    title: str
    order: Mapping[str, tuple[str, ...]]
    labels: Mapping[str, str]

    def label(self, name: str) -> str:
        """A name for people."""
        return self.labels.get(name) or name.replace(".", ", ").replace("_", " ").capitalize()

    def is_baseline(self, quantity: str) -> bool:
        """Whether it stands under a score that has to beat it."""
        return any(quantity in baselines for baselines in self.order.values())

    def in_order(self, quantities: Sequence[str]) -> list[str]:
        """Those with a place first, in the order of the table."""
        ordered = [name for leader, baselines in self.order.items() for name in (leader, *baselines)]
        return [name for name in ordered if name in quantities] + [name for name in quantities if name not in ordered]


@dataclass(frozen=True)
class Cell:
    """A score in print: value, spread, and the number of values behind it."""

    value: str
    spread: str
    count: str


@dataclass(frozen=True)
class Row:
    """A line of a table; `cells` follow the columns of the table, None where there is no score."""

    label: str
    unit: str
    cells: tuple[Cell | None, ...]
    note: str
    is_baseline: bool = False


@dataclass(frozen=True)
class Table:
    """A titled table of scores."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]


@dataclass(frozen=True)
class Headline:
    """A number for the top of the page, with what it means."""

    label: str
    value: str
    note: str


def tables(scores: Scores, subject: Subject) -> list[Table]:
    """Reproduction with training and held-out columns, then one table for each other group."""
    found = [reproduction_table(scores, subject)] if any(_is_reproduction(name) for name in scores) else []
    others = [name for name in scores if not _is_reproduction(name)]
    for group, names in groupby(others, key=lambda name: name.rpartition(".")[0]):
        rows = tuple(_single_row(name, scores[name], subject) for name in names)
        found.append(Table(TITLES.get(group, subject.label(group)), ("value",), rows))
    return found


def reproduction_table(scores: Scores, subject: Subject) -> Table:
    """Training and held-out demonstrations side by side."""
    quantities = list(dict.fromkeys(name.partition(".")[2] for name in scores if _is_reproduction(name)))
    sets = [name for name in SETS if any(score.startswith(f"{name}.") for score in scores)]
    rows = []
    for one in subject.in_order(quantities):
        found = [scores.get(f"{name}.{one}") for name in sets]
        known = [score for score in found if score is not None]
        notes = " · ".join(dict.fromkeys(_note(score) for score in known))
        cells = tuple(None if score is None else cell(score) for score in found)
        rows.append(Row(subject.label(one), _unit(known[0]), cells, notes, subject.is_baseline(one)))
    return Table(subject.title, tuple(SETS[name] for name in sets), tuple(rows))


def quantity(scores: Scores, name: str) -> str:
    """A score with its unit, in print; says so if it was not judged."""
    score = scores.get(name)
    return "not judged" if score is None else f"{cell(score).value} {_unit(score)}".rstrip()


def cell(score: Mapping[str, Any]) -> Cell:
    """A score in print; "±" only where the value is the middle of what it summarises."""
    count, spread = score.get("count", 1), score.get("spread")
    statistic = str(score.get("statistic", "mean"))
    if statistic == "share":
        return Cell(_percentage(score["value"]), "", f"of {count}")
    shown = _number(spread, digits=2) if count > 1 and spread not in (0, None) else ""
    if statistic in CENTRAL:
        return Cell(_number(score["value"]), f"± {shown}" if shown else "", f"n = {count}")
    details = [statistic, f"n = {count}", f"standard deviation {shown}" if shown else ""]
    return Cell(_number(score["value"]), "", ", ".join(detail for detail in details if detail))


def _is_reproduction(name: str) -> bool:
    return name.partition(".")[0] in SETS


def _single_row(name: str, score: Mapping[str, Any], subject: Subject) -> Row:
    return Row(subject.label(name.rpartition(".")[2]), _unit(score), (cell(score),), _note(score))


def _unit(score: Mapping[str, Any]) -> str:
    unit = str(score.get("unit", "1"))
    return "" if unit == "1" else unit


def _note(score: Mapping[str, Any]) -> str:
    return str(score.get("note", ""))


def _number(value: float | None, digits: int = 3) -> str:
    if value is None:
        return "not finite"
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.{digits}g}"


def _percentage(value: float | None) -> str:
    return "not finite" if value is None else f"{100 * value:.3g} %"
