"""Scores of several runs side by side."""

import math
from collections.abc import Mapping
from typing import Any

from geomotion.tables import aligned, number

OBJECTIVE = (
    "heldout.dtwd_per_point",
    "heldout.position_dtwd_ratio",
    "train.dtwd_per_point",
    "train.position_dtwd_ratio",
)


def objective(scores: Mapping[str, Any]) -> float | None:
    """The score that sweeps minimise: held-out DTWD where there is one, that of the training set otherwise."""
    for name in OBJECTIVE:
        if name in scores["scores"]:
            value = scores["scores"][name]["value"]
            return math.inf if value is None else float(value)  # null: a rollout diverged
    return None


def comparison(documents: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Scores by name and run; a run without a score is left out of its row."""
    names = list(dict.fromkeys(name for document in documents.values() for name in document["scores"]))
    rows = {
        name: {run: document["scores"][name] for run, document in documents.items() if name in document["scores"]}
        for name in names
    }
    return {"datasets": {run: document["dataset"] for run, document in documents.items()}, "scores": rows}


def comparison_table(comparison: Mapping[str, Any]) -> str:
    """Plain text: one row a score, one column a run."""
    runs = list(comparison["datasets"])
    heads = [f"{run} ({comparison['datasets'][run]})" for run in runs]
    lines = [["score", "unit", *heads]]
    for name, row in comparison["scores"].items():
        unit = next(iter(row.values()))["unit"]
        lines.append([name, unit, *(_cell(row.get(run)) for run in runs)])
    return aligned(lines)


def _cell(score: Mapping[str, Any] | None) -> str:
    return "-" if score is None else number(score["value"], score["spread"])
