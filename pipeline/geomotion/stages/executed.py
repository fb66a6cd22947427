"""What a simulated arm did, whatever led it: numbers, lines for people, a trajectory, and what is drawn."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.figures.replay import ReplayPicture
from geomotion.robot.arm import Arm
from geomotion.robot.recording import Tracking


def tracking_document(arm: Arm, tracking: Tracking, among_obstacles: bool) -> dict[str, Any]:
    """Numbers about a motion, as JSON types."""
    return {
        "arm": arm.name,
        "frame": arm.tip_link,
        "duration_s": float(tracking.time_s[-1]),
        "tracking_worst_m": float(tracking.position_error_m.max()),
        "tracking_worst_rad": float(tracking.orientation_error_rad.max()),
        "limit_margin_rad": finite_or_none(tracking.limit_margin_rad.min()),
        "self_clearance": _self_clearance(tracking),
        "clearance_m": tracking.smallest_clearance_m if among_obstacles else {},
        "contacts": tracking.contact_steps,
    }


def tracking_rows(document: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What :func:`tracking_document` says of limits and distances, for people."""
    rows = []
    if document["limit_margin_rad"] is not None:
        rows.append(("joint-limit margin", f"{np.degrees(document['limit_margin_rad']):.1f} deg"))
    if document["self_clearance"] is not None:
        links, apart = document["self_clearance"]["links"], document["self_clearance"]["distance_m"]
        rows.append(("links to each other", f"{1000 * apart:.1f} mm ({' to '.join(links)})"))
    if document["clearance_m"]:
        link, apart = min(document["clearance_m"].items(), key=lambda item: item[1])
        rows.append(("smallest clearance", f"{1000 * apart:.1f} mm ({link})"))
        rows.append(("contacts", ", ".join(document["contacts"]) or "none"))
    return rows


def executed_trajectory(
    demonstrations: Demonstrations, arm: Arm, tracking: Tracking, label: str, doing: str
) -> Demonstrations:
    """What was executed, in the layout of demonstrations, to be run elsewhere.

    Args:
        demonstrations: What it was learned from.
        arm: What moved.
        tracking: How.
        label: Of the trajectory.
        doing: What was done by geomotion to get it.
    """
    channels = {
        "position_m": tracking.position_m,
        "orientation_wxyz": tracking.orientation_wxyz,
        "joints_rad": tracking.commanded_joints_rad,
    }
    return Demonstrations(
        f"{demonstrations.name}/replay",
        (Trajectory(tracking.time_s - tracking.time_s[0], channels, label),),
        "R3xS3xjoint",
        f"{arm.base_link} of {arm.name}; poses of {arm.tip_link}",
        f"{doing} {demonstrations.name} and executed in simulation; {demonstrations.source}",
        demonstrations.licence,
    )


def tracking_picture(arm: Arm, tracking: Tracking, stretch: float = 1.0) -> ReplayPicture:
    """What is drawn of a motion that takes `stretch` times as long as by its own timing."""
    commanded_m, _ = arm.chain.pose(tracking.commanded_joints_rad)
    return ReplayPicture(
        tracking.time_s,
        tracking.position_error_m,
        tracking.orientation_error_rad,
        tracking.limit_margin_rad,
        tracking.clearance_time_s,
        tracking.clearance_m,
        commanded_m,
        tracking.position_m,
        stretch,
    )


def finite_or_none(value: float) -> float | None:
    """JSON has no word for infinity."""
    return float(value) if np.isfinite(value) else None


def _self_clearance(tracking: Tracking) -> dict[str, Any] | None:
    """The two links that come nearest to each other; None if all stay as far apart as is measured."""
    if not tracking.self_clearance_m:
        return None
    links, distance_m = min(tracking.self_clearance_m.items(), key=lambda item: item[1])
    return {"links": list(links), "distance_m": distance_m}
