"""What a robot made of a path, in sentences."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from geomotion.figures.replay import ORIENTATION_LIMIT_DEG, POSITION_LIMIT_MM
from geomotion.figures.report.verdict import Finding
from geomotion.robot.recording import MAX_CLEARANCE_M

Document = Mapping[str, Any]
NO_ROBOT = "the demonstrations are neither poses in R³×S³, which a robot could take, nor configurations of an arm"


def executed(replay: Document | None) -> Document | None:
    """Contents of ``replay.json`` if there was a replay stage and it had a path to execute."""
    return replay if replay is not None and replay.get("executed", True) else None


def findings(replay: Document | None) -> list[Finding]:
    """Tracking, reach, contacts and replanning, or why there is nothing of them."""
    if replay is None:
        return [Finding(f"It was not executed: {NO_ROBOT}.")]
    done = executed(replay)
    if done is None:
        return [Finding(f"It was not executed: {replay['reason']}.", is_good=False)]
    return [_tracking(done), *_reach(done), *_contacts(done), *_self_collision(done), *_closed_loop(done)]


def mm(length_m: float) -> str:
    """A length in print."""
    return f"{_short(1000 * length_m)} mm"


def deg(angle_rad: float) -> str:
    """An angle in print."""
    return f"{_short(float(np.degrees(angle_rad)))}°"


def _short(value: float) -> str:
    """Three digits, but no more than two behind the point."""
    return f"{value:.3g}" if abs(value) >= 1 else f"{value:.2f}"


def _tracking(replay: Document) -> Finding:
    error_m, error_rad = float(replay["tracking_worst_m"]), float(replay["tracking_worst_rad"])
    margin_rad = replay["limit_margin_rad"]
    is_followed = 1000 * error_m <= POSITION_LIMIT_MM and np.degrees(error_rad) <= ORIENTATION_LIMIT_DEG
    asked = "" if is_followed else f" (asked for are {POSITION_LIMIT_MM:g} mm and {ORIENTATION_LIMIT_DEG:g}°)"
    text = f"Measured in simulation: the arm follows with at most {mm(error_m)} and {deg(error_rad)} of error{asked}"
    if margin_rad is None:
        return Finding(f"{text}; its joints have no limits.", is_good=bool(is_followed))
    margin = f"every joint stays {deg(margin_rad)} or more away from" if margin_rad >= 0 else "a joint goes beyond"
    return Finding(f"{text}, and {margin} its limits.", is_good=bool(is_followed and margin_rad >= 0))


def _reach(replay: Document) -> list[Finding]:
    poses = replay["unreachable"]
    if not poses:
        return []
    worst = max(poses, key=lambda one: float(one["position_error_m"]))
    share = f"{100 * (1 - replay['reached_share']):.2g} %"
    remains = f"{mm(worst['position_error_m'])} and {deg(worst['orientation_error_rad'])} remain"
    text = f"The arm cannot take {len(poses)} of the poses ({share}); at worst, at pose {worst['index']}, {remains}."
    return [Finding(text, is_good=False)]


def _contacts(replay: Document) -> list[Finding]:
    touched = [f"{obstacle} ({', '.join(links)})" for obstacle, links in replay["contacts"].items() if links]
    if touched:
        return [Finding(f"Measured in simulation: the arm touches {'; '.join(touched)}.", is_good=False)]
    if not replay["clearance_m"]:
        return []
    link, nearest_m = min(replay["clearance_m"].items(), key=lambda item: float(item[1]))
    name = f" ({link})" if nearest_m < MAX_CLEARANCE_M else ""
    near = f"nothing of the arm comes nearer to an obstacle than {mm(nearest_m)}{name}"
    return [Finding(f"Measured in simulation: {near}.")]


def _self_collision(replay: Document) -> list[Finding]:
    own = replay["self_clearance"]
    if own is None or own["distance_m"] >= 0:
        return []
    overlap = f"{' and '.join(own['links'])} overlap by {mm(-own['distance_m'])}"
    return [Finding(f"Measured in simulation, which takes links as convex: {overlap}.", is_good=False)]


def _closed_loop(replay: Document) -> list[Finding]:
    if not replay["closed_loop"]:
        return []
    median_ms = replay["replan_median_ms"]
    took = "" if median_ms is None else f", in {median_ms:.2g} ms each (median)"
    has_arrived = replay.get("reached_goal") is not False
    end = "" if has_arrived else "; it did not arrive at the goal"
    return [
        Finding(f"While the arm moved, its path was planned anew {replay['replans']} times{took}{end}.", has_arrived)
    ]
