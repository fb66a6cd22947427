"""What obstacles do to the nodes of a decoded grid: how much room is left, and how much the metric grows."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial.transform import Rotation

from geomotion.errors import InvalidSetting
from geomotion.obstacles.ambient import ambient_factor, combine_factors, reach_m
from geomotion.obstacles.motion import MovingBody
from geomotion.scores.paths import QUATERNION, MotionPath

ROUNDING_M = 1e-5  # of single precision
STATES_AT_ONCE = 500  # looked at with small balls
NEGLIGIBLE = 0.01  # by which a factor may differ from one where an obstacle is not looked at


@runtime_checkable
class RobotShape(Protocol):
    """Balls that move with a robot, and together contain what must not touch obstacles.

    Attributes:
        radii_m: Their radii, shape (ball,).
        blocks: Which block of the embedded positions each ball belongs to, shape (ball,).
        finer: The same in more and smaller balls, which cost more; None if there is nothing finer.
    """

    @property
    def finer(self) -> "RobotShape | None": ...

    @property
    def radii_m(self) -> Float[np.ndarray, " ball"]: ...

    @property
    def blocks(self) -> Int[np.ndarray, " ball"]: ...

    def points(self, states: MotionPath) -> Float[np.ndarray, "state ball Dx"]:
        """Centres of the balls [m]."""
        ...

    def travel_m(self, states: MotionPath, pairs: Int[np.ndarray, "pair 2"]) -> Float[np.ndarray, " pair"]:
        """Upper bound on how far any ball moves from the first to the second state of each pair [m]."""
        ...


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
    def finer(self) -> None:
        """These balls are all there are."""
        return None

    @property
    def lever_m(self) -> float:
        """Largest distance of a centre from the origin [m]: how far a ball moves for each radian of turning."""
        return float(np.linalg.norm(self.centres_m, axis=1).max())

    @property
    def blocks(self) -> Int[np.ndarray, " ball"]:
        """All belong to the end effector's position."""
        return np.zeros(len(self.radii_m), dtype=int)

    def points(self, states: MotionPath) -> Float[np.ndarray, "state ball Dx"]:
        """Centres of the balls [m]."""
        if self.lever_m == 0 or states.orientation.shape[1] != QUATERNION:
            return np.repeat(states.position_m[:, None], len(self.radii_m), axis=1)
        turns = Rotation.from_quat(states.orientation, scalar_first=True)
        turned = [turns.apply(centre) for centre in self.centres_m]
        return np.asarray(states.position_m[:, None] + np.stack(turned, axis=1))

    def travel_m(self, states: MotionPath, pairs: Int[np.ndarray, "pair 2"]) -> Float[np.ndarray, " pair"]:
        """Upper bound on how far any ball moves from the first to the second state of each pair [m]."""
        first, second = pairs.T
        travel = np.linalg.norm(states.position_m[second] - states.position_m[first], axis=1)
        if self.lever_m > 0:
            cosine = np.einsum("pd,pd->p", states.orientation[first], states.orientation[second])
            travel = travel + self.lever_m * 2 * np.arccos(np.abs(cosine).clip(max=1))
        return np.asarray(travel)


class Balls:
    """Balls of a robot in many states, ready to be asked which of them are near something.

    Args:
        points_m: Their centres [m].
        shape: Radii and blocks.
    """

    def __init__(self, points_m: Float[np.ndarray, "state ball Dx"], shape: RobotShape) -> None:
        self.points_m, self.radii_m, self.blocks = points_m, shape.radii_m, shape.blocks
        self._flat = points_m.reshape(-1, points_m.shape[-1]).astype(np.float32)  # all of them, each time
        self._squares = np.einsum("pd,pd->p", self._flat, self._flat)
        self._of_blocks = [np.flatnonzero(self.blocks == block) for block in np.unique(self.blocks)]

    def are_near(self, place_m: Float[np.ndarray, " Dx"], reach_m: float) -> Bool[np.ndarray, "state ball"]:
        """Balls that reach into a ball around a place, or nearly so."""
        squares = (self._squares - self._flat @ (2 * place_m).astype(np.float32)).reshape(self.points_m.shape[:2])
        return np.asarray(squares <= (reach_m + self.radii_m + ROUNDING_M) ** 2 - place_m @ place_m)

    def are_nearest(
        self, place_m: Float[np.ndarray, " Dx"], reach_m: float, spread_m: float
    ) -> Bool[np.ndarray, "state ball"]:
        """Those of them that no ball of the same block is nearer to the place than by more than the spread."""
        squares = self._squares - self._flat @ (2 * place_m).astype(np.float32) + np.float32(place_m @ place_m)
        apart = np.sqrt(squares.clip(min=0)).reshape(self.points_m.shape[:2]) - self.radii_m.astype(np.float32)
        found = np.zeros(apart.shape, dtype=bool)
        for own in self._of_blocks:
            of_block = apart[:, own]
            farthest = np.minimum(of_block.min(axis=1) + spread_m, reach_m) + 2 * ROUNDING_M
            found[:, own] = of_block <= farthest[:, None]
        return found


@dataclass(frozen=True)
class Felt:
    """The nodes that obstacles reach.

    Attributes:
        nodes: Their numbers.
        factor: Ambient factors of (3.15) there, for each block of the embedded positions.
        room_m: Distance to the nearest obstacle less the wanted clearance there [m].
    """

    nodes: Int[np.ndarray, " felt"]
    factor: Float[np.ndarray, "B felt"]
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
    points_m: Float[np.ndarray, "state ball Dx"],
    radii_m: Float[np.ndarray, " ball"],
    time_s: float,
    horizon_s: float = 0.0,
) -> Float[np.ndarray, "body state"]:
    """Smallest distance between each obstacle and any ball [m]."""
    return np.asarray(_of_balls(bodies, points_m, radii_m, time_s, horizon_s).min(axis=2))


def _of_balls(
    bodies: Sequence[MovingBody],
    points_m: Float[np.ndarray, "state ball Dx"],
    radii_m: Float[np.ndarray, " ball"],
    time_s: float,
    horizon_s: float,
) -> Float[np.ndarray, "body state ball"]:
    flat = points_m.reshape(-1, points_m.shape[-1])
    rows = [
        (body.swept_distance(flat, time_s, horizon_s) if horizon_s > 0 else body.signed_distance(flat, time_s))
        for body in bodies
    ]
    return np.array([row.reshape(points_m.shape[:-1]) - radii_m for row in rows])


def feel(
    bodies: Sequence[MovingBody],
    balls: Balls,
    constraint: Constraint,
    longest_travel_m: float,
    time_s: float,
    block_count: int = 1,
) -> Felt:
    """Look only at balls within reach of an obstacle: closer than an edge can matter, or than the metric is changed.

    Balls of a block share its factor: that of the nearest of them. The metric does not grow where a block has none.
    """
    radii_m, blocks, size = balls.radii_m, balls.blocks, float(balls.radii_m.max())
    needed_m = constraint.clearance_m + longest_travel_m
    near = np.zeros(balls.points_m.shape[:2], dtype=bool)
    for body in bodies:
        reach = max(needed_m, _soft_reach_m(body.body.inradius + size, constraint.gain))
        place_m, reach_m = _whereabouts(body, time_s, constraint.horizon_s, reach)
        if constraint.gain > 0:  # far around, where only the nearest ball of a block counts
            near |= balls.are_nearest(place_m, reach_m, _spread_m(body, time_s, constraint.horizon_s))
        else:
            near |= balls.are_near(place_m, reach_m)
    nodes = np.flatnonzero(near.any(axis=1))
    near, factor = near[nodes], np.ones((block_count, len(nodes)))
    apart = np.full((len(bodies), *near.shape), np.inf)
    row, ball = np.nonzero(near)
    if len(nodes) > 0:
        points_m = balls.points_m[nodes[row], ball][:, None]
        found = _of_balls(bodies, points_m, np.zeros(1), time_s, constraint.horizon_s)[:, :, 0] - radii_m[ball]
        apart[:, row, ball] = found
    for block in np.unique(blocks) if constraint.gain > 0 else ():
        own = blocks == block
        radius, nearest = float(radii_m[own].max()), apart[:, :, own].min(axis=2)
        factors = [
            ambient_factor(one, body.body.inradius + radius, constraint.gain)
            for one, body in zip(nearest, bodies, strict=True)
        ]
        factor[block] = combine_factors(factors)
    room = np.full(len(nodes), np.inf)
    if constraint.hard:
        room = apart.min(axis=(0, 2), initial=np.inf) - constraint.clearance_m
    return Felt(nodes, factor, room)


def closer_look(
    felt: Felt,
    states: MotionPath,
    shape: RobotShape,
    bodies: Sequence[MovingBody],
    constraint: Constraint,
    longest_travel_m: float,
    time_s: float,
) -> Felt:
    """The same nodes, those where edges might be closed looked at with another shape of the robot.

    Args:
        felt: What was found.
        states: Of its nodes.
        shape: In smaller balls.
        bodies: Obstacles.
        constraint: How they act.
        longest_travel_m: Of a ball along an edge.
        time_s: When they are looked at.
    """
    room_m, close = felt.room_m.copy(), np.flatnonzero(felt.room_m < max(longest_travel_m, ROUNDING_M))
    for begin in range(0, len(close), STATES_AT_ONCE):
        some = close[begin : begin + STATES_AT_ONCE]
        points_m = shape.points(states.with_vectors(states.vectors[some]))
        apart_m = distances(bodies, points_m, shape.radii_m, time_s, constraint.horizon_s).min(axis=0)
        room_m[some] = np.maximum(room_m[some], apart_m - constraint.clearance_m)
    return replace(felt, room_m=room_m)


def _soft_reach_m(radius_m: float, gain: float) -> float:
    return reach_m(radius_m, NEGLIGIBLE / gain) if gain > NEGLIGIBLE else 0.0


def _spread_m(body: MovingBody, time_s: float, horizon_s: float) -> float:
    """By how much distances to an obstacle may differ from those to its whereabouts, more or less [m]."""
    travelled_m = body.motion.travelled(time_s, time_s + horizon_s)
    return body.bounding_radius_m - body.body.inradius + travelled_m


def _whereabouts(
    body: MovingBody, time_s: float, horizon_s: float, reach: float
) -> tuple[Float[np.ndarray, " Dx"], float]:
    """A ball around everything within `reach` of an obstacle, wherever it gets to meanwhile: centre and radius [m]."""
    begin, end = body.centre_m(time_s), body.centre_m(time_s + horizon_s)
    radius_m = body.bounding_radius_m + reach + body.motion.travelled(time_s, time_s + horizon_s) / 2
    return (begin + end) / 2, radius_m
