"""The regression gate: scores of a pinned experiment against a stored baseline.

A baseline is a JSON file: ``{"scores": {name: {"value": …, "better": "lower" | "higher", "tolerance": …,
"reason": …}}}``; the tolerance is absolute, in the score's unit, and its reason stands beside it.
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from geomotion.config import CheckConfig
from geomotion.errors import InvalidSetting, MissingData
from geomotion.files import read_json, write_bytes, write_json
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
    "train.position_dtwd": "lower",
    "train.orientation_dtwd": "lower",
    "nearby.claimed.bound_excess": "lower",
    "pushes.back_within_10mm": "lower",
    "pushes.left_at_end": "lower",
    "pushes.claimed.bound_excess": "lower",
    "certificate.proven": "higher",
    "certificate.rate_per_s": "higher",
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


def check(config: CheckConfig, scores: Mapping[str, Any], certificate: Mapping[str, Any] | None = None) -> Verdict:
    """Compare scores with the baseline, or write them into it (``check.update=true``), making it if there is none.

    Args:
        config: Which baseline, whether to update it, and whether to leave a JUnit file.
        scores: Document of an evaluation.
        certificate: Its certificate, where the program gives one; what it claims is judged like a score.

    Raises:
        InvalidSetting: If no baseline is named.
        MissingData: If the named file does not exist and is not to be made.
    """
    if config.baseline is None:
        raise InvalidSetting("check.baseline", "null", "a baseline file; experiment=regression/… names its own")
    path = Path(config.baseline)
    found = {name: score["value"] for name, score in scores["scores"].items()} | _claims(certificate)
    baseline = _baseline(path, config.update, found)
    rows = [_judge(name, expected, found.get(name)) for name, expected in baseline["scores"].items()]
    passed = config.update or all(row["verdict"] in ("ok", "better") for row in rows)
    if config.update:
        for row in rows:
            if row["now"] is not None:
                baseline["scores"][row["name"]]["value"] = row["now"]
        write_json(path, baseline)
    if config.junit is not None:
        write_bytes(Path(config.junit), junit(path.stem, rows, config.update))
    title = f"wrote {path}" if config.update else ("nothing got worse" if passed else "WORSE than the baseline")
    return Verdict(passed, f"{_table(rows)}\n\n{title}", {"passed": passed, "baseline": str(path), "rows": rows})


def junit(name: str, rows: list[dict[str, Any]], is_update: bool) -> bytes:
    """A test suite in the XML that continuous integration reads: one case a score."""
    failures = [] if is_update else [row for row in rows if row["verdict"] in ("worse", "missing")]
    suite = ET.Element("testsuite", name=f"regression.{name}", tests=str(len(rows)), failures=str(len(failures)))
    for row in rows:
        case = ET.SubElement(suite, "testcase", classname=f"regression.{name}", name=row["name"])
        if row in failures:
            ET.SubElement(
                case, "failure", message=f"{row['verdict']}: {row['now']} for {row['baseline']}"
            ).text = f"tolerance {row['tolerance']}: {row['reason']}"
    return bytes(ET.tostring(suite, encoding="utf-8", xml_declaration=True))


def _claims(certificate: Mapping[str, Any] | None) -> dict[str, float | None]:
    if certificate is None:
        return {}
    is_proven = certificate["claim"] == "by_construction"
    return {"certificate.proven": float(is_proven), "certificate.rate_per_s": certificate["rate_per_s"]}


def _baseline(path: Path, update: bool, found: Mapping[str, float | None]) -> dict[str, Any]:
    if path.is_file():
        baseline: dict[str, Any] = read_json(path)
        return baseline
    if not update:
        raise MissingData(f"baseline {path}", "Make it with check.update=true, or name another with check.baseline=")
    kept = {}
    for name, better in NEW_BASELINE.items():
        value = found.get(name)
        if value is not None:
            reason = f"{NEW_TOLERANCE:.0%} of the value when the baseline was made"
            kept[name] = {"value": value, "better": better, "tolerance": NEW_TOLERANCE * abs(value), "reason": reason}
    return {"scores": kept}


def _judge(name: str, expected: Mapping[str, Any], now: float | None) -> dict[str, Any]:
    return {
        "name": name,
        "baseline": expected["value"],
        "tolerance": expected["tolerance"],
        "reason": expected["reason"],
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
