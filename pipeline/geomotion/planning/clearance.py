"""Distances that a robot surely keeps from obstacles, between the states that a path consists of."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from geomotion.obstacles.motion import MovingBody
from geomotion.planning.obstruction import RobotShape, distances
from geomotion.scores.paths import MotionPath

Places = Float[np.ndarray, " place"]  # on a path, in steps from its beginning
TOLERANCE_M = 1e-3  # how far a bound may be below the true distance
HALVINGS = 12  # of a step, at most


def kept_clearances(
    states: MotionPath, shape: RobotShape, bodies: Sequence[MovingBody], time_s: float, horizon_s: float = 0.0
) -> Float[np.ndarray, " step"]:
    """For each step of a path, a distance to all obstacles that is kept all along it [m]; of one state, its own.

    With the distances d, e at its ends and the travel L of the robot between them, every state of a step keeps at least
    (d + e - L) / 2, because distances are 1-Lipschitz. Steps are halved until that is nearly the distance itself, where
    it may be the smallest of the path: so the smallest of these bounds is nearly the clearance of the path.
    """
    vectors, steps = states.vectors, np.arange(len(states))

    def at(places: Places) -> MotionPath:
        return states.with_vectors(np.stack([np.interp(places, steps, axis) for axis in vectors.T], axis=1))

    def apart(places: Places) -> Places:
        return np.asarray(distances(bodies, shape.points(at(places)), shape.radii_m, time_s, horizon_s).min(axis=0))

    known = apart(steps.astype(float))
    if len(known) == 1:
        return known
    begin, end, first, last = steps[:-1].astype(float), steps[1:].astype(float), known[:-1], known[1:]
    kept, smallest = np.full(len(begin), np.inf), float(known.min())
    for halving in range(HALVINGS + 1):
        count = np.arange(len(begin))
        travel = shape.travel_m(at(np.concatenate([begin, end])), np.stack([count, count + len(begin)], axis=1))
        bound = (first + last - travel) / 2
        is_open = (bound < smallest - TOLERANCE_M) & (halving < HALVINGS)
        np.minimum.at(kept, begin[~is_open].astype(int), bound[~is_open])
        if not is_open.any():
            break
        begin, end, first, last = (part[is_open] for part in (begin, end, first, last))
        middle = (begin + end) / 2
        between = apart(middle)
        smallest = min(smallest, float(between.min()))
        begin, end = np.concatenate([begin, middle]), np.concatenate([middle, end])
        first, last = np.concatenate([first, between]), np.concatenate([between, last])
    return kept
