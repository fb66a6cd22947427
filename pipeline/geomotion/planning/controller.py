"""A control loop on a manifold: replan, move on, and get out of the way where there is no way on."""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from geomotion.obstacles.motion import MovingBody
from geomotion.planning.curve import FittedCurve
from geomotion.planning.ends import NOTHING
from geomotion.planning.manifold import DecodedPath
from geomotion.planning.obstruction import distances
from geomotion.planning.planner import Planner
from geomotion.planning.replanner import Replanner
from geomotion.scores.paths import MotionPath

Pace = Callable[[float], float]
"""Progress → how fast to go there [m/s], as :meth:`MotionPath.steps_m` measures."""
CAUTION = (1.0, 0.5)  # shares of the horizon, tried in turn; with less, standing still or giving way is safer
STANDOFF = 2.0  # times the clearance: with that much room, standing still is safe enough
ESCAPE_REACH_M = 0.15  # how far the way out is looked for
ESCAPES, ESCAPES_APART_M = 5, 0.04  # ways out that are compared, and how far from each other they end
ESCAPE_LOOKS = 12  # moments on a way out at which its distance to obstacles is looked at
BLEND_M, BLEND = 0.04, 2.0  # over which the step from one way to the next is spread, and at least over twice its length
ARRIVED = 1e-6  # difference of vectors of states to the goal


@dataclass(frozen=True)
class ControllerSettings:
    """How a controller moves.

    Attributes:
        period_s: Time between two steps [s].
        look_every: Steps between two looks at whether the way is still free.
        replan_every_s: Time after which a way that is still free is planned anew [s]: a shorter one may have opened.
        escape_m_per_s: Pace of getting out of the way [m/s].
    """

    period_s: float
    look_every: int = 4
    replan_every_s: float = 0.5
    escape_m_per_s: float = 0.4


class Following:
    """A curve that is being followed, entered from a state beside it without a jump.

    Args:
        curve: To follow, from where it is nearest.
        state: The robot's, of length one.
        code: Its latent point.
    """

    def __init__(self, curve: FittedCurve, state: MotionPath, code: Float[np.ndarray, " d"]) -> None:
        self.curve = curve
        self._states = curve.path.states
        self._behind_m = np.concatenate([[0.0], np.cumsum(self._states.steps_m())])
        self._at_m = float(self._behind_m[np.linalg.norm(curve.codes - code, axis=1).argmin()])
        self._gone_m = 0.0
        beside = self._values(self._states.vectors, np.array([self._at_m]))
        self._aside = state.vectors[0] - beside[0]
        aside_m = float(state.with_vectors(np.concatenate([beside, state.vectors])).steps_m()[0])
        self._blend_m = max(BLEND_M, BLEND * aside_m)

    def go(self, way_m: float) -> None:
        """Move on along the curve, no farther than to its end."""
        self._gone_m += way_m
        self._at_m = min(self._at_m + way_m, float(self._behind_m[-1]))

    @property
    def state(self) -> MotionPath:
        """Where the robot should be, of length one."""
        return self._followed(np.array([self._at_m]))

    @property
    def code(self) -> Float[np.ndarray, " d"]:
        """Its latent point."""
        return np.asarray(self._values(self.curve.codes, np.array([self._at_m]))[0])

    @property
    def progress(self) -> float:
        """Share of the demonstrated motion that is done there."""
        return float(np.interp(self._at_m, self._behind_m, self.curve.path.progress))

    @property
    def ahead(self) -> FittedCurve:
        """What is still to be followed, from here on."""
        way_m = np.concatenate([[self._at_m], self._behind_m[self._behind_m > self._at_m]])
        progress = np.interp(way_m, self._behind_m, self.curve.path.progress)
        return replace(self.curve, path=DecodedPath(self._followed(way_m), progress))

    def _followed(self, at_m: Float[np.ndarray, " place"]) -> MotionPath:
        fading = (1 - (self._gone_m + at_m - self._at_m) / self._blend_m).clip(min=0)
        beside = self._values(self._states.vectors, at_m)
        return self._states.with_vectors(beside + fading[:, None] * self._aside)

    def _values(
        self, along: Float[np.ndarray, "point k"], at_m: Float[np.ndarray, " place"]
    ) -> Float[np.ndarray, "place k"]:
        return np.stack([np.interp(at_m, self._behind_m, axis) for axis in along.T], axis=1)


class GeodesicController:
    """The next state, each time it is asked, among obstacles that move.

    Each plan keeps its clearance to everywhere the obstacles get to within the planner's horizon. Where no such path
    exists, less foresight is tried; where there is none at all, the controller stands still if there is room, and
    otherwise takes the way out that stays farthest from the obstacles, each looked at when the robot gets there.

    Args:
        planner: Plans on the decoded graph; its constraint says clearance and horizon.
        start: Where the motion begins.
        goal: Where it ends.
        pace: How fast to go.
        settings: How to move.
    """

    def __init__(
        self, planner: Planner, start: MotionPath, goal: MotionPath, pace: Pace, settings: ControllerSettings
    ) -> None:
        self.planner, self.pace, self.settings = planner, pace, settings
        self._replanners = [Replanner(_looking_ahead(planner, share), start, goal) for share in CAUTION]
        self.query = self._replanners[0].query
        for replanner in self._replanners[1:]:
            replanner.query = self.query  # one for all: the graph takes up another one in milliseconds
        self._carried = self.query.states.vectors
        self.state = self.query.ends[:1]
        self.code = planner.surface.grid.nodes[self.query.start]
        self.plans = 0
        self.waited_s = 0.0
        self._way: Following | None = None
        self._escapes = False
        self._steps, self._planned_s = 0, -np.inf

    @property
    def arrived(self) -> bool:
        """Whether the robot is at the goal."""
        return bool(np.abs(self.state.vectors - self.query.ends[-1:].vectors).max() < ARRIVED)

    def step(self, time_s: float, bodies: Sequence[MovingBody]) -> MotionPath:
        """The state to be in one period later, of length one."""
        if self._steps % self.settings.look_every == 0 and not self._can_go_on(time_s, bodies):
            self._replan(time_s, bodies)
        self._steps += 1
        if self._way is None:
            self.waited_s += 0.0 if self.arrived else self.settings.period_s
            return self.state
        pace = self.settings.escape_m_per_s if self._escapes else self.pace(self._way.progress)
        self._way.go(pace * self.settings.period_s)
        self.state, self.code = self._way.state, self._way.code
        return self.state

    def _can_go_on(self, time_s: float, bodies: Sequence[MovingBody]) -> bool:
        """Whether the rest of the way is still free, and fresh or at its end."""
        if self._way is None or self._escapes:
            return False
        if time_s - self._planned_s > self.settings.replan_every_s and not self.arrived:
            return False
        wanted = self.planner.settings.constraint.clearance_m
        kept = self.planner.clearances(self._way.ahead, bodies, time_s, enough_m=wanted)
        return bool(kept.min(initial=np.inf) >= wanted)

    def _replan(self, time_s: float, bodies: Sequence[MovingBody]) -> None:
        here = self._replanners[0].node_at(self.code)
        self.plans, self._planned_s, self._escapes = self.plans + 1, time_s, False
        for replanner in self._replanners:
            curve = replanner.replan(bodies, time_s, here, self._state_near(here))
            if curve is not None:
                self._way = Following(curve, self.state, self.code)
                return
        self._way = None
        room_m = self._room_m(self.planner.settings.shape.points(self.state), time_s, bodies)[0]
        if room_m < STANDOFF * self.planner.settings.constraint.clearance_m:
            self._give_way(here, float(room_m), time_s, bodies)

    def _give_way(self, here: int, room_m: float, time_s: float, bodies: Sequence[MovingBody]) -> None:
        """Follow the way out with most room, obstacles looked at when the robot gets there; none: stand still."""
        self.planner.graph.feel(*NOTHING)
        for target, room_there_m in self._refuges(here, time_s, bodies):
            found = self.planner.graph.shortest_path(here, target)
            if not found.exists:
                continue
            there = self.query.states[target : target + 1]
            away = self.planner.ends.onward(replace(self.query, goal=target, ends=there), here, self._state_near(here))
            way = Following(self.planner.fit(away, found), self.state, self.code)
            kept_m = min(room_there_m, self._room_on_the_way_m(way, time_s, bodies))
            if kept_m > room_m:
                self._way, self._escapes, room_m = way, True, kept_m

    def _state_near(self, node: int) -> MotionPath:
        """What the state would be at a node close by, where a plan begins, as far from the manifold as it is here."""
        here = self.planner.surface.grid.interpolate(self._carried, self.code[None])
        return self.state.with_vectors(self.state.vectors + self._carried[[node]] - here)

    def _refuges(self, here: int, time_s: float, bodies: Sequence[MovingBody]) -> list[tuple[int, float]]:
        """Nodes in reach, apart from each other, where most room remains, with that room [m]."""
        states, nodes = self.query.states, self.query.nodes
        positions_m = states.with_vectors(states.vectors[nodes]).position_m
        reach_m = np.linalg.norm(positions_m - states[here : here + 1].position_m, axis=1)
        near: Int[np.ndarray, " open"] = np.flatnonzero(reach_m < ESCAPE_REACH_M)
        room_m = self._room_m(self.query.balls.points_m[near], time_s, bodies)
        found: list[tuple[int, float]] = []
        while len(near) > 0 and len(found) < ESCAPES:
            best = int(room_m.argmax())
            found.append((int(nodes[near[best]]), float(room_m[best])))
            apart = np.linalg.norm(positions_m[near] - positions_m[near[best]], axis=1) > ESCAPES_APART_M
            near, room_m = near[apart], room_m[apart]
        return found

    def _room_m(
        self, points_m: Float[np.ndarray, "state ball Dx"], time_s: float, bodies: Sequence[MovingBody]
    ) -> Float[np.ndarray, " state"]:
        """Smallest distance to obstacles over the horizon [m]."""
        settings = self.planner.settings
        apart = distances(bodies, points_m, settings.shape.radii_m, time_s, settings.constraint.horizon_s)
        return np.asarray(apart.min(axis=0))

    def _room_on_the_way_m(self, way: Following, time_s: float, bodies: Sequence[MovingBody]) -> float:
        """Smallest distance to obstacles while the robot gets to the end of a way [m]."""
        states, shape = way.ahead.path.states.resampled(ESCAPE_LOOKS), self.planner.settings.shape
        times_s = time_s + np.concatenate([[0.0], np.cumsum(states.steps_m())]) / self.settings.escape_m_per_s
        points_m = shape.points(states)[:, None]
        looks = zip(points_m, times_s.tolist(), strict=True)
        return float(min(distances(bodies, one, shape.radii_m, at_s).min() for one, at_s in looks))


def _looking_ahead(planner: Planner, share: float) -> Planner:
    """The same planner, on the same graph, with a share of its horizon."""
    constraint = planner.settings.constraint
    nearer = copy(planner)
    nearer.settings = replace(planner.settings, constraint=replace(constraint, horizon_s=share * constraint.horizon_s))
    return nearer
