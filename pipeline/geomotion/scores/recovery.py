"""How a disturbed motion comes back to the undisturbed one."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from geomotion.scores.pushes import RECOVERED, RETURNS, settled

Series = Float[np.ndarray, " time"]


@dataclass(frozen=True)
class Deviation:
    """How far a motion is from another one.

    Attributes:
        time_s: Increasing [s].
        to_path_m: Distance of the position to the nearest point of the other path [m].
        claimed: Distance to the other state of the same time, in the metric where contraction is claimed.
    """

    time_s: Series
    to_path_m: Series
    claimed: Series


@dataclass(frozen=True)
class Recovery:
    """What happened after a disturbance, until something else does.

    Attributes:
        pushed_m: Largest distance to the undisturbed path since it began [m].
        back_s: Distance [mm] -> time from its end until the motion stays as near as that [s]; infinite if it does not.
        claimed_rate_per_s: ln 5 over the time until the claimed distance is a fifth of that at its end [1/s]; NaN if it
            does not fall as far.
    """

    pushed_m: float
    back_s: dict[int, float]
    claimed_rate_per_s: float


def recovery(deviation: Deviation, begins_s: float, ends_s: float, until_s: float) -> Recovery:
    """How a motion recovers from a disturbance.

    Args:
        deviation: Of the whole motion.
        begins_s: When the disturbance begins [s].
        ends_s: When it is over [s].
        until_s: When the next one begins, the goal changes, or the motion ends [s].
    """
    time_s = deviation.time_s
    first, released, last = np.searchsorted(time_s, [begins_s, ends_s, until_s])
    after = slice(min(released, len(time_s) - 1), max(last, released + 1))
    waited = time_s[after] - time_s[after][0]
    to_path_m, claimed = deviation.to_path_m[None, after], deviation.claimed[None, after]
    fallen_s = float(settled(claimed, waited, float(claimed[0, 0]) / RECOVERED)[0])
    return Recovery(
        float(deviation.to_path_m[first : max(last, first + 1)].max()),
        {limit_mm: float(settled(to_path_m, waited, limit_mm / 1000)[0]) for limit_mm, _ in RETURNS},
        math.log(RECOVERED) / fallen_s if 0 < fallen_s < math.inf else math.nan,
    )
