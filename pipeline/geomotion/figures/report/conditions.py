"""The few scores that tell conditions apart, as rows of a table."""

from collections.abc import Mapping, Sequence
from typing import Any

HEADS = {  # by name of score
    "train.dtwd_per_point": "DTWD",
    "train.dtwd_ratio": "DTWD / between demonstrations",
    "heldout.dtwd_per_point": "held-out DTWD",
    "train.relative_velocity_error": "velocity error",
    "train.end_point_error": "end point",
    "goal.never_reached": "never reach the goal",
    "equilibrium.end_distance": "equilibrium to end",
}


def condition_rows(conditions: Sequence[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    """Heads, and then one row for each of the ``conditions`` of ``scores.json``."""
    known = [name for name in HEADS if any(name in one["scores"] for one in conditions)]
    heads = ("condition", *(HEADS[name] for name in known))
    return [heads, *((one["name"], *(_cell(one["scores"].get(name)) for name in known)) for one in conditions)]


def _cell(score: Mapping[str, Any] | None) -> str:
    if score is None or score["value"] is None:
        return "-" if score is None else "not finite"
    unit = "" if score["unit"] == "1" else f" {score['unit']}"
    return f"{score['value']:.3g}{unit}"
