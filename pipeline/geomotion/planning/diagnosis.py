"""Why there is no path: obstacles by name, or the cap on how far a path may leave the demonstrations."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from geomotion.obstacles.motion import MovingBody
from geomotion.planning.plan import Plan, PlanStatus

if TYPE_CHECKING:
    from geomotion.planning.ends import Query
    from geomotion.planning.planner import Planner

NO_CODES = np.zeros((0, 0))


def diagnose(planner: "Planner", query: "Query", bodies: Sequence[MovingBody], time_s: float) -> Plan:
    """Take obstacles away, one and then all, and see what a path needs."""
    if not planner.search(query, (), time_s).exists:
        crossing = replace(query, is_open=query.is_within)
        found = planner.search(crossing, (), time_s)
        if found.exists:
            return planner.judged(crossing, planner.fit(crossing, found), np.inf)
        settings = planner.settings
        limits = f"{1000 * settings.cap_m:.0f} mm and {np.degrees(settings.cap_rad):.0f} deg"
        reason = (
            f"{PlanStatus.cap_reached.value} ({limits}); planning.leave_data_m= and planning.leave_data_rad= allow more"
        )
        return Plan(PlanStatus.cap_reached, reason, NO_CODES)
    alone = [body.name for body in bodies if _opens(planner, query, [one for one in bodies if one is not body], time_s)]
    each = [] if alone else [body.name for body in bodies if not _opens(planner, query, [body], time_s)]
    names = tuple(alone or each or [body.name for body in bodies])
    joint = "" if len(names) == 1 else ", each by itself" if each else " together"
    reason = f"{PlanStatus.blocked.value}: {', '.join(names)}{joint}; planning.leave_data_m= would allow a wider detour"
    return Plan(PlanStatus.blocked, reason, NO_CODES, blocking=names)


def _opens(planner: "Planner", query: "Query", bodies: Sequence[MovingBody], time_s: float) -> bool:
    return planner.route(query, bodies, time_s) is not None
