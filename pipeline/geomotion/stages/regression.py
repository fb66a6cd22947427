"""The regression gate: scores of a pinned experiment against a stored baseline.

A baseline is a JSON file: ``{"scores": {name: {"value": …, "better": "lower" | "higher", "tolerance": …,
"reason": …}}}``; the tolerance is absolute, in the score's unit, and its reason stands beside it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from geomotion.config import CheckConfig
from geomotion.errors import InvalidSetting, MissingData
from geomotion.files import read_json, write_json
from geomotion.tables import aligned

NEW_BASELINE = {  # scores of a baseline that is made from nothing, and which way each is better
    "train.dtwd_per_point": "lower",
    "train.relative_velocity_error": "lower",
    "train.end_point_error": "lower",
    "heldout.dtwd_per_point": "lower",
    "contraction.claimed.rate": "lower",
    "contraction.claimed.non_contracting_fraction": "lower",
    "region.steps_inside": "higher",
    "goal.never_reached": "lower",
    "heldout.position_dtwd_ratio": "lower",
    "heldout.orientation_dtwd_ratio": "lower",
    "heldout.farthest_from_data": "lower",
    "heldout.planned_share": "higher",
    "pairs.planned_share": "higher",
}
NEW_TOLERANCE = 0.1  # of the value


@dataclass(frozen=True)
class Verdict:
    """Outcome of a check.

    Attributes:
        passed: Whether nothing got worse.
        text: Table for people.
        document: The same for programs.
    """

    passed: bool
    text: str
    document: dict[str, Any]


def check(config: CheckConfig, scores: Mapping[str, Any]) -> Verdict:
    """Compare scores with the baseline, or write them into it (``check.update=true``), making it if there is none.

    Raises:
        InvalidSetting: If no baseline is named.
        MissingData: If the named file does not exist and is not to be made.
    """
    if config.baseline is None:
        raise InvalidSetting("check.baseline", "null", "a baseline file; experiment=regression/… names its own")
    path = Path(config.baseline)
    baseline = _baseline(path, config.update, scores)
    rows = [_judge(name, expected, scores["scores"].get(name)) for name, expected in baseline["scores"].items()]
    passed = config.update or all(row["verdict"] in ("ok", "better") for row in rows)
    if config.update:
        for row in rows:
            if row["now"] is not None:
                baseline["scores"][row["name"]]["value"] = row["now"]
        write_json(path, baseline)
    title = f"wrote {path}" if config.update else ("nothing got worse" if passed else "WORSE than the baseline")
    return Verdict(passed, f"{_table(rows)}\n\n{title}", {"passed": passed, "baseline": str(path), "rows": rows})


def _baseline(path: Path, update: bool, scores: Mapping[str, Any]) -> dict[str, Any]:
    if path.is_file():
        baseline: dict[str, Any] = read_json(path)
        return baseline
    if not update:
        raise MissingData(f"baseline {path}", "Make it with check.update=true, or name another with check.baseline=")
    kept = {}
    for name, better in NEW_BASELINE.items():
        value = scores["scores"].get(name, {}).get("value")
        if value is not None:
            reason = f"{NEW_TOLERANCE:.0%} of the value when the baseline was made"
            kept[name] = {"value": value, "better": better, "tolerance": NEW_TOLERANCE * abs(value), "reason": reason}
    return {"scores": kept}


def _judge(name: str, expected: Mapping[str, Any], found: Mapping[str, Any] | None) -> dict[str, Any]:
    now = None if found is None else found["value"]
    return {
        "name": name,
        "baseline": expected["value"],
        "tolerance": expected["tolerance"],
        "now": now,
        "verdict": "missing" if now is None else _verdict(expected, now),
    }


def _verdict(expected: Mapping[str, Any], now: float) -> str:
    worsening = now - expected["value"] if expected["better"] == "lower" else expected["value"] - now
    if worsening > expected["tolerance"]:
        return "worse"
    return "better" if worsening < -expected["tolerance"] else "ok"


def _table(rows: list[dict[str, Any]]) -> str:
    lines = [("score", "baseline", "now", "tolerance", "verdict")]
    for row in rows:
        now = "-" if row["now"] is None else f"{row['now']:.4g}"
        lines.append((row["name"], f"{row['baseline']:.4g}", now, f"{row['tolerance']:.2g}", row["verdict"]))
    return aligned(lines)
