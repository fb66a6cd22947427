"""Distances that a robot surely keeps from obstacles, between the states that a path consists of."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from geomotion.obstacles.motion import MovingBody
from geomotion.planning.obstruction import RobotShape, distances
from geomotion.scores.paths import MotionPath

TOLERANCE_M = 1e-3  # how far a bound may be below the true distance
MOST_PIECES = 2000  # of a step


def kept_clearances(
    states: MotionPath,
    shape: RobotShape,
    bodies: Sequence[MovingBody],
    time_s: float,
    horizon_s: float = 0.0,
    enough_m: float = np.inf,
) -> Float[np.ndarray, " step"]:
    """For each step of a path, a distance to all obstacles that is kept all along it [m]; of one state, its own.

    With the distances d, e at its ends and the travel L of the robot between them, every state of a step keeps at least
    (d + e - L) / 2, because distances are 1-Lipschitz. Where that may be the smallest of the path, a step is cut into
    pieces so short that it is nearly the distance itself: the smallest of these bounds is nearly the clearance.

    Args:
        states: Of the path.
        shape: Of the robot.
        bodies: Obstacles.
        time_s: When they are looked at.
        horizon_s: They count as being everywhere they get to within this time [s].
        enough_m: Steps that surely keep that much are not cut, so that their bounds may be far below the distance.
    """
    steps = np.arange(len(states))
    apart = _apart_m(states, shape, bodies, time_s, horizon_s)
    if len(states) == 1:
        return apart
    travel = shape.travel_m(states, np.stack([steps[:-1], steps[1:]], axis=1))
    kept = np.asarray((apart[:-1] + apart[1:] - travel) / 2)
    rough = np.flatnonzero(kept < min(float(apart.min()) - TOLERANCE_M, enough_m))
    if len(rough) == 0:
        return kept
    pieces = np.ceil(travel[rough] / (2 * TOLERANCE_M)).clip(1, MOST_PIECES).astype(int)
    first = np.cumsum(pieces) - pieces  # of each of these steps
    share, count = np.repeat(1 / pieces, pieces), int(pieces.sum())
    begin = np.repeat(rough, pieces) + (np.arange(count) - np.repeat(first, pieces)) * share
    places = np.concatenate([begin, begin + share])
    cut = states.with_vectors(np.stack([np.interp(places, steps, axis) for axis in states.vectors.T], axis=1))
    apart = _apart_m(cut, shape, bodies, time_s, horizon_s)
    moved = shape.travel_m(cut, np.stack([np.arange(count), np.arange(count, 2 * count)], axis=1))
    kept[rough] = np.minimum.reduceat((apart[:count] + apart[count:] - moved) / 2, first)
    return kept


def _apart_m(
    states: MotionPath, shape: RobotShape, bodies: Sequence[MovingBody], time_s: float, horizon_s: float
) -> Float[np.ndarray, " state"]:
    return np.asarray(distances(bodies, shape.points(states), shape.radii_m, time_s, horizon_s).min(axis=0))
