"""Scores as rows of tables, each beside what it has to be compared with."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from geomotion.scores.table import TITLES

Scores = Mapping[str, Mapping[str, Any]]
CENTRAL = ("mean", "pooled")  # statistics that lie in the middle of their values
SETS = {"train": "training", "heldout": "held out"}

# In the order of the table; under each score, the baselines that it has to beat.
REPRODUCTION: Mapping[str, tuple[str, ...]] = {
    "dtwd_per_point": ("dtwd_to_nearest_demo", "dtwd_of_averaged_demo", "dtwd_between_demos"),
    "dtwd_ratio": (),
    "ratio_to_nearest_demo": (),
    "relative_velocity_error": ("nearest_neighbour_velocity_error",),
}
LABELS = {
    "dtwd_per_point": "DTWD, per point",
    "dtwd_sum": "DTWD, summed",
    "dtwd_ratio": "DTWD / distance between demonstrations",
    "ratio_to_nearest_demo": "DTWD / distance to the nearest demonstration",
    "dtwd_to_nearest_demo": "nearest other demonstration instead",
    "dtwd_of_averaged_demo": "averaged demonstration instead",
    "dtwd_between_demos": "any other demonstration instead",
    "dtw": "Dynamic time warping, per point",
    "dtw_sum": "Dynamic time warping, summed",
    "frechet": "Fréchet distance",
    "relative_velocity_error": "Relative velocity error",
    "nearest_neighbour_velocity_error": "velocity of the nearest known state instead",
    "velocity_rmse": "Velocity error (RMS)",
    "time_aligned_rmse": "Distance at equal times (RMS)",
    "rate": "Contraction rate (largest eigenvalue)",
    "mean_rate": "Mean of the largest eigenvalue",
    "ratio": "Contraction ratio",
    "non_contracting_fraction": "Share of points that do not contract",
    "max_expansion": "Largest distance / initial distance",
    "final_ratio": "Final distance / initial distance",
    "growing_share": "Share of time steps in which the distance grows",
    "bound_excess": "Largest excess over the proven bound / initial distance",
    "never_reached": "Starts that never reach the goal",
}


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


def tables(scores: Scores) -> list[Table]:
    """Reproduction with training and held-out columns, then one table for each other group."""
    found = [reproduction_table(scores)] if any(_is_reproduction(name) for name in scores) else []
    others = [name for name in scores if not _is_reproduction(name)]
    for group, names in groupby(others, key=lambda name: name.rpartition(".")[0]):
        rows = tuple(_single_row(name, scores[name]) for name in names)
        found.append(Table(TITLES.get(group, label(group)), ("value",), rows))
    return found


def reproduction_table(scores: Scores) -> Table:
    """Training and held-out demonstrations side by side."""
    quantities = list(dict.fromkeys(name.partition(".")[2] for name in scores if _is_reproduction(name)))
    sets = [name for name in SETS if any(score.startswith(f"{name}.") for score in scores)]
    rows = []
    for quantity in _in_order(quantities):
        found = [scores.get(f"{name}.{quantity}") for name in sets]
        known = [score for score in found if score is not None]
        notes = " · ".join(dict.fromkeys(_note(score) for score in known))
        is_baseline = any(str(score.get("note", "")).startswith("baseline") for score in known)
        cells = tuple(None if score is None else cell(score) for score in found)
        rows.append(Row(label(quantity), _unit(known[0]), cells, notes, is_baseline))
    title = "Reproduction of the demonstrations, from their own starts"
    return Table(title, tuple(SETS[name] for name in sets), tuple(rows))


def headlines(scores: Scores) -> list[Headline]:
    """The few numbers to look at first, as far as they were judged."""
    chosen = []
    for name, kind in (("heldout", "held-out"), ("train", "training")):
        if f"{name}.dtwd_per_point" in scores:
            note = f"mean DTWD per point; nearest other one: {_quantity(scores, f'{name}.dtwd_to_nearest_demo')}"
            value = _quantity(scores, f"{name}.dtwd_per_point")
            chosen.append(Headline(f"Distance to {kind} demonstrations", value, note))
    errors = [f"{name}.relative_velocity_error" for name in reversed(SETS)]
    if name := next((name for name in errors if name in scores), ""):
        kind = SETS[name.partition(".")[0]].replace(" ", "-")
        note = f"on {kind} demonstrations; 0 is perfect, 1 as good as standing still"
        chosen.append(Headline("Relative velocity error", _quantity(scores, name), note))
    if "goal.never_reached" in scores:
        note = f"of {scores['goal.never_reached'].get('count', '?')} starts around the demonstrations"
        chosen.append(Headline("Never reach the goal", _quantity(scores, "goal.never_reached"), note))
    return chosen


def _quantity(scores: Scores, name: str) -> str:
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


def label(name: str) -> str:
    """A name for people."""
    return LABELS.get(name) or name.replace(".", ", ").replace("_", " ").capitalize()


def _is_reproduction(name: str) -> bool:
    return name.partition(".")[0] in SETS


def _single_row(name: str, score: Mapping[str, Any]) -> Row:
    return Row(label(name.rpartition(".")[2]), _unit(score), (cell(score),), _note(score))


def _in_order(quantities: list[str]) -> list[str]:
    ordered = [name for leader, baselines in REPRODUCTION.items() for name in (leader, *baselines)]
    return [name for name in ordered if name in quantities] + [name for name in quantities if name not in ordered]


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
