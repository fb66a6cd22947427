"""What obstacles do to the nodes of a decoded grid: how much room is left, and how much the metric grows."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial.transform import Rotation

from geomotion.errors import InvalidSetting
from geomotion.obstacles.ambient import ambient_factor, combine_factors, reach_m
from geomotion.obstacles.motion import MovingBody
from geomotion.scores.paths import QUATERNION, PosePath

NEGLIGIBLE = 0.01  # by which a factor may differ from one where an obstacle is not looked at


@dataclass(frozen=True)
class Tool:
    """Balls fixed to the end effector: a grasped object, or the hand itself.

    Attributes:
        centres_m: In the frame of the end effector, shape (ball, 3); none is the same as one in its origin.
        radii_m: Their radii, shape (ball,); zero for a point.

    Raises:
        InvalidSetting: If they differ in number, or a radius is negative.
    """

    centres_m: Float[np.ndarray, "ball 3"] = field(default_factory=lambda: np.zeros((1, 3)))
    radii_m: Float[np.ndarray, " other_ball"] = field(default_factory=lambda: np.zeros(1))

    def __post_init__(self) -> None:
        if len(self.centres_m) != len(self.radii_m) or len(self.radii_m) == 0:
            raise InvalidSetting(
                "tool", (len(self.centres_m), len(self.radii_m)), "as many centres as radii, one or more"
            )
        if (self.radii_m < 0).any():
            raise InvalidSetting("tool.radii_m", self.radii_m.tolist(), "radii of 0 or more")

    @property
    def lever_m(self) -> float:
        """Largest distance of a centre from the origin [m]: how far a ball moves for each radian of turning."""
        return float(np.linalg.norm(self.centres_m, axis=1).max())

    def points(self, poses: PosePath) -> Float[np.ndarray, "pose ball Dx"]:
        """Centres of the balls at poses."""
        if self.lever_m == 0 or poses.orientation.shape[1] != QUATERNION:
            return np.repeat(poses.position_m[:, None], len(self.radii_m), axis=1)
        turns = Rotation.from_quat(poses.orientation, scalar_first=True)
        turned = [turns.apply(centre) for centre in self.centres_m]
        return np.asarray(poses.position_m[:, None] + np.stack(turned, axis=1))


def travel_m(poses: PosePath, pairs: Int[np.ndarray, "pair 2"], tool: Tool) -> Float[np.ndarray, " pair"]:
    """Upper bound on how far any ball of the tool moves from the first to the second pose of each pair [m]."""
    first, second = pairs.T
    travel = np.linalg.norm(poses.position_m[second] - poses.position_m[first], axis=1)
    if tool.lever_m > 0:
        cosine = np.einsum("pd,pd->p", poses.orientation[first], poses.orientation[second])
        travel = travel + tool.lever_m * 2 * np.arccos(np.abs(cosine).clip(max=1))
    return np.asarray(travel)


@dataclass(frozen=True)
class Felt:
    """The nodes that obstacles reach.

    Attributes:
        nodes: Their numbers.
        factor: Ambient factor of (3.15) there.
        room_m: Distance to the nearest obstacle less the wanted clearance there [m].
    """

    nodes: Int[np.ndarray, " felt"]
    factor: Float[np.ndarray, " felt"]
    room_m: Float[np.ndarray, " felt"]


@dataclass(frozen=True)
class Constraint:
    """How obstacles act.

    Attributes:
        clearance_m: Distance that is kept [m], if `hard`.
        hard: Close edges that might come closer. An obstacle is then never touched.
        gain: ζ of (3.15); 0 for none. By itself a soft constraint, which proves nothing.
        horizon_s: Obstacles count as being everywhere they get to within this time [s].
    """

    clearance_m: float = 0.01
    hard: bool = True
    gain: float = 0.0
    horizon_s: float = 0.0


def distances(
    bodies: Sequence[MovingBody],
    points_m: Float[np.ndarray, "pose ball Dx"],
    radii_m: Float[np.ndarray, " ball"],
    time_s: float,
    horizon_s: float = 0.0,
) -> Float[np.ndarray, "body pose"]:
    """Smallest distance between each obstacle and any ball of a tool at poses [m]."""
    flat = points_m.reshape(-1, points_m.shape[-1])
    rows = [
        (body.swept_distance(flat, time_s, horizon_s) if horizon_s > 0 else body.signed_distance(flat, time_s))
        for body in bodies
    ]
    return np.array([(row.reshape(points_m.shape[:-1]) - radii_m).min(axis=1) for row in rows])


def feel(
    bodies: Sequence[MovingBody],
    points_m: Float[np.ndarray, "node ball Dx"],
    tool: Tool,
    constraint: Constraint,
    longest_travel_m: float,
    time_s: float,
) -> Felt:
    """Look only at nodes within reach of an obstacle: closer than an edge can matter, or than the metric is changed."""
    size = float(tool.radii_m.max())
    needed = constraint.clearance_m + longest_travel_m
    near = np.zeros(len(points_m), dtype=bool)
    for body in bodies:
        reach = max(needed, _soft_reach_m(body.body.inradius + size, constraint.gain)) + size
        near |= _within_reach(points_m, body, time_s, constraint.horizon_s, reach)
    nodes = np.flatnonzero(near)
    if len(nodes) == 0:
        return Felt(nodes, np.zeros(0), np.zeros(0))
    apart = distances(bodies, points_m.take(nodes, axis=0), tool.radii_m, time_s, constraint.horizon_s)
    factors = [
        ambient_factor(row, body.body.inradius + size, constraint.gain) for row, body in zip(apart, bodies, strict=True)
    ]
    room = apart.min(axis=0) - constraint.clearance_m if constraint.hard else np.full(len(nodes), np.inf)
    return Felt(nodes, combine_factors(factors), room)


def _soft_reach_m(radius_m: float, gain: float) -> float:
    return reach_m(radius_m, NEGLIGIBLE / gain) if gain > NEGLIGIBLE else 0.0


def _within_reach(
    points_m: Float[np.ndarray, "node ball Dx"], body: MovingBody, time_s: float, horizon_s: float, reach: float
) -> Bool[np.ndarray, " node"]:
    """Nodes with a ball closer than `reach` to the bounding ball of an obstacle, wherever it gets to meanwhile."""
    begin, end = body.centre_m(time_s), body.centre_m(time_s + horizon_s)
    radius = body.bounding_radius_m + reach + body.motion.travelled(time_s, time_s + horizon_s) / 2
    middle, balls = (begin + end) / 2, points_m.reshape(-1, points_m.shape[-1])
    squares = np.einsum("pd,pd->p", balls, balls) - balls @ (2 * middle)  # less that of the middle
    return np.asarray((squares <= radius**2 - middle @ middle).reshape(points_m.shape[:2]).any(axis=1))
