"""What the simulator's geometry says of a planned path of configurations: links, self-collision, joint limits."""

from collections.abc import Mapping
from typing import Any

from geomotion.figures.report.gms_execution import deg, mm
from geomotion.figures.report.page import Column, Listing
from geomotion.figures.report.verdict import Finding

Document = Mapping[str, Any]


def check_findings(plan: Document) -> list[Finding]:
    """The smallest distances and margins over all legs, in one sentence; nothing where none were measured.

    Args:
        plan: Contents of ``plan.json``, every leg found.
    """
    checks = _checks(plan)
    if not checks:
        return []
    near = [_between(one) for check in checks for one in check["clearances"][:1]]
    own = [_between(check["self_clearance"]) for check in checks if check["self_clearance"] is not None]
    limits = [(float(check["limit"]["margin_rad"]), check["limit"]["joint"]) for check in checks if check["limit"]]
    parts = []
    if plan["obstacles"]:
        parts.append(f"no link comes nearer to an obstacle than {_smallest(near, checks)}")
    parts.append(f"no two links that could collide come nearer to each other than {_smallest(own, checks)}")
    if limits:
        margin_rad, joint = min(limits)
        parts.append(f"every joint stays {deg(margin_rad)} or more inside its limits ({joint} comes nearest)")
    text = f"{', '.join(parts[:-1])}, and {parts[-1]}" if parts[1:] else parts[0]
    return [Finding(f"Measured on the planned path, by the simulator's shapes of the links: {text}.")]


def check_listings(plan: Document) -> list[Listing]:
    """Distances of each link to each obstacle, of the two nearest links, and the joint nearest to a limit."""
    rows = []
    for number, leg in enumerate(plan["legs"]):
        check = leg.get("checks")
        if check is None:
            continue
        name = f"{leg['from']} to {leg['to']}" if "from" in leg else f"leg {number + 1}"
        own = [] if check["self_clearance"] is None else [check["self_clearance"]]
        for one in (*check["clearances"], *own):
            rows.append((name, " to ".join(one["bodies"]), mm(one["distance_m"]), str(one["row"])))
        if (limit := check["limit"]) is not None:
            rows.append((name, f"{limit['joint']} to its limit", deg(limit["margin_rad"]), str(limit["row"])))
    columns = (Column("leg"), Column("between", is_text=True), Column("smallest"), Column("at point of the path"))
    return [Listing("The planned path, measured by the simulator's shapes", columns, tuple(rows))] if rows else []


def _checks(plan: Document) -> list[Document]:
    return [leg["checks"] for leg in plan["legs"] if leg.get("checks") is not None]


def _between(one: Document) -> tuple[float, str]:
    return float(one["distance_m"]), " to ".join(one["bodies"])


def _smallest(found: list[tuple[float, str]], checks: list[Document]) -> str:
    if not found:
        return mm(min(float(check["up_to_m"]) for check in checks))
    distance_m, names = min(found)
    return f"{mm(distance_m)} ({names})"
