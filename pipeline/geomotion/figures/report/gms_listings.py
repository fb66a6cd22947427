"""What was planned and executed, as tables."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from geomotion.figures.report.gms_checks import check_listings
from geomotion.figures.report.gms_execution import executed
from geomotion.figures.report.gms_verdict import leg_name
from geomotion.figures.report.page import Column, Listing
from geomotion.robot.recording import MAX_CLEARANCE_M

Document = Mapping[str, Any]
UNREACHABLE_SHOWN = 10


def listings(plan: Document, replay: Document | None) -> tuple[Listing, ...]:
    """Legs of the plan, then what the robot did, as far as there is anything to tell.

    Args:
        plan: Contents of ``plan.json``.
        replay: Contents of ``replay.json``; None without a replay stage.
    """
    found = [_legs("The plan", plan["legs"])]
    if plan.get("others"):
        found.append(_legs("Other starts and goals", plan["others"]))
    found += check_listings(plan)
    if (done := executed(replay)) is not None:
        found += [_execution(done), *_clearances(done), *_unreachable(done)]
    return tuple(found)


def _legs(title: str, legs: Sequence[Document]) -> Listing:
    names = (
        "leg", "length (graph)", "energy (straight line)", "clearance [mm]", "from the data [mm, deg]",
        "manifold to start [mm, deg]", "manifold to goal [mm, deg]",
    )  # fmt: skip
    columns = (*(Column(name) for name in names), Column("outcome", is_text=True))
    return Listing(title, columns, tuple(_leg(leg, number) for number, leg in enumerate(legs)))


def _leg(leg: Document, number: int) -> tuple[str, ...]:
    scores = leg["scores"]
    outcome = "found" if leg["status"] == "found" else str(leg["reason"])
    if scores is None:
        return (leg_name(leg, number), *["–"] * 6, outcome)
    length = f"{scores['length']:.3g} ({scores['graph_length']:.3g})"
    energy = f"{scores['energy']:.3g} ({scores['line_energy']:.3g})"
    clearance = "no obstacle" if scores["clearance_m"] is None else f"{1000 * scores['clearance_m']:.1f}"
    distances = (_pair(scores, name) for name in ("apart", "start_residual", "goal_residual"))
    return (leg_name(leg, number), length, energy, clearance, *distances, outcome)


def _pair(scores: Document, name: str) -> str:
    return f"{1000 * scores[f'{name}_m']:.1f}, {np.degrees(scores[f'{name}_rad']):.1f}"


def _execution(replay: Document) -> Listing:
    rows = {
        "arm": str(replay["arm"]),
        "end-effector frame": str(replay["frame"]),
        "timing": f"{replay['timing']}, stretched {replay['stretch']:.2f} times",
        "duration": f"{replay['duration_s']:.2f} s",
    }
    if replay["states"] == "poses":
        rows["poses reached by inverse kinematics"] = f"{100 * replay['reached_share']:.4g} %"
        rows["inverse kinematics, worst"] = _error(replay, "ik_worst")
    rows["tracking error, worst"] = _error(replay, "tracking_worst")
    margin_rad, own = replay["limit_margin_rad"], replay["self_clearance"]
    rows["smallest joint-limit margin"] = "no limits" if margin_rad is None else f"{np.degrees(margin_rad):.1f} deg"
    rows["links nearest to each other"] = (
        _links(own) if own is not None else f"none within {1000 * MAX_CLEARANCE_M:.0f} mm"
    )
    if replay["closed_loop"]:
        median = replay["replan_median_ms"]
        rows["replanned"] = f"{replay['replans']} times" + ("" if median is None else f", {median:.2g} ms median")
        rows["waited for obstacles"] = f"{replay.get('waited_s', 0.0):.2f} s"
    return Listing("On the simulated robot", (Column("what"), Column("value", is_text=True)), tuple(rows.items()))


def _links(own: Document) -> str:
    return f"{1000 * own['distance_m']:.1f} mm ({' to '.join(own['links'])})"


def _error(replay: Document, name: str) -> str:
    return f"{1000 * replay[f'{name}_m']:.2f} mm, {np.degrees(replay[f'{name}_rad']):.2f} deg"


def _clearances(replay: Document) -> list[Listing]:
    if not replay["clearance_m"]:
        return []
    contacts: Document = replay["contacts"]
    rows = []
    for link, clearance_m in sorted(replay["clearance_m"].items(), key=lambda item: float(item[1])):
        touched = [f"{obstacle}, {links[link]} steps" for obstacle, links in contacts.items() if link in links]
        distance = f"{1000 * clearance_m:.1f}" + (" or more" if clearance_m >= MAX_CLEARANCE_M else "")
        rows.append((link, distance, "; ".join(touched) or "none"))
    columns = (Column("link"), Column("smallest clearance [mm]"), Column("contacts", is_text=True))
    return [Listing("Clearance of the links, measured", columns, tuple(rows))]


def _unreachable(replay: Document) -> list[Listing]:
    poses: list[Document] = replay["unreachable"]
    if not poses:
        return []
    shown = sorted(poses, key=lambda one: -float(one["position_error_m"]))[:UNREACHABLE_SHOWN]
    more = "" if len(shown) == len(poses) else f", the worst {len(shown)} of {len(poses)}"
    rows = tuple((str(one["index"]), *_remains(one)) for one in shown)
    columns = (Column("pose"), Column("remaining distance [mm]"), Column("remaining angle [deg]"))
    return [Listing(f"Poses out of reach{more}", columns, rows)]


def _remains(one: Document) -> tuple[str, str]:
    return f"{1000 * one['position_error_m']:.1f}", f"{np.degrees(one['orientation_error_rad']):.1f}"
