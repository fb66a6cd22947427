"""A control loop on a manifold: replan, move on, and get out of the way where there is no way on."""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from geomotion.manifolds.graph import GraphPath
from geomotion.obstacles.motion import MovingBody
from geomotion.planning.carrying import of_vectors, vectors
from geomotion.planning.curve import FittedCurve
from geomotion.planning.manifold import DecodedPath
from geomotion.planning.obstruction import distances
from geomotion.planning.planner import Planner, Query
from geomotion.scores.paths import PosePath

Pace = Callable[[float], float]
"""Progress → how fast demonstrations are there [m/s], a radian counting as `lever_m`."""
LEVER_M = 0.1
CAUTION = (1.0, 0.5)  # shares of the horizon, tried in turn; with less, standing still or giving way is safer
STANDOFF = 2.0  # times the clearance: with that much room, standing still is safe enough
ESCAPE_REACH_M = 0.15  # how far the way out is looked for
BLEND_M = 0.04  # over which the step from one way to the next is spread


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
    look_every: int = 2
    replan_every_s: float = 0.5
    escape_m_per_s: float = 0.4


class GeodesicController:
    """The next pose, each time it is asked, among obstacles that move.

    Each plan keeps its clearance to everywhere the obstacles get to within the planner's horizon. Where no such path
    exists, less foresight is tried; where there is none at all, the controller stands still if there
    is room, and otherwise goes where there is most.

    Args:
        planner: Plans on the decoded graph; its constraint says clearance and horizon.
        query: Start and goal.
        pace: How fast to go.
        settings: How to move.
    """

    def __init__(self, planner: Planner, query: Query, pace: Pace, settings: ControllerSettings) -> None:
        self.planner, self.query, self.pace, self.settings = planner, query, pace, settings
        self._planners = [_looking_ahead(planner, share) for share in CAUTION]
        self.pose = query.ends[:1]
        self.code = planner.surface.grid.nodes[query.start]
        self.plans = 0
        self.waited_s = 0.0
        self._curve: FittedCurve | None = None
        self._lengths = np.zeros(1)
        self._at_m, self._steps, self._escapes = 0.0, 0, False
        self._planned_s = -np.inf
        self._step_aside = np.zeros(vectors(self.pose).shape[1])
        self._blended_m = 0.0
        self._last: GraphPath | None = None

    @property
    def arrived(self) -> bool:
        """Whether the goal is reached."""
        return bool(self._curve is not None and not self._escapes and self._at_m >= self._lengths[-1])

    def step(self, time_s: float, bodies: Sequence[MovingBody]) -> PosePath:
        """The pose to be at one period later, shape (1,)."""
        if self._steps % self.settings.look_every == 0 and not self._can_go_on(time_s, bodies):
            self._replan(time_s, bodies)
        self._steps += 1
        if self._curve is None:
            self.waited_s += self.settings.period_s
            return self.pose
        speed = self.settings.escape_m_per_s if self._escapes else self.pace(self._progress())
        self._blended_m += speed * self.settings.period_s
        self._at_m = min(self._at_m + speed * self.settings.period_s, float(self._lengths[-1]))
        self._move()
        return self.pose

    def _replan(self, time_s: float, bodies: Sequence[MovingBody]) -> None:
        here = int(self.planner.surface.grid.nearest(self.code[None])[0])
        self._planned_s = time_s
        query = self._query_from(here)
        self.plans += 1
        for planner in self._planners:
            route = planner.route(query, bodies, time_s, self._last)
            if route is not None:
                self._last = route.found
                self._take(route.curve, escapes=False)
                return
        self._last = None
        room = self._room(time_s, bodies, np.array([here]))[0]
        if room >= STANDOFF * self.planner.settings.constraint.clearance_m:
            self._curve = None
            return
        self._escape(query, time_s, bodies)

    def _escape(self, query: Query, time_s: float, bodies: Sequence[MovingBody]) -> None:
        """Follow the shortest way, whatever is there, to the node in reach that stays farthest from all obstacles."""
        points = query.poses.position_m
        near = np.flatnonzero(query.is_open & (np.linalg.norm(points - points[query.start], axis=1) < ESCAPE_REACH_M))
        room = self._room(time_s, bodies, near)
        self.planner.graph.feel(np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros(0))
        for target in near[np.argsort(-room)][:5]:
            found = self.planner.graph.shortest_path(query.start, int(target))
            if found.exists and len(found.nodes) > 1:
                ends = PosePath(
                    np.concatenate([self.pose.position_m, points[[target]]]),
                    np.concatenate([self.pose.orientation, query.poses.orientation[[target]]]),
                )
                away = replace(query, goal=int(target), ends=ends)
                self._take(self.planner.fit(away, found), escapes=True)
                return
        self._curve = None

    def _room(self, time_s: float, bodies: Sequence[MovingBody], nodes: np.ndarray) -> Float[np.ndarray, " node"]:
        """Smallest distance to obstacles over the horizon [m]."""
        if not bodies:
            return np.full(len(nodes), np.inf)
        tool, horizon_s = self.planner.settings.tool, self.planner.settings.constraint.horizon_s
        return np.asarray(distances(bodies, self.query.points_m[nodes], tool.radii_m, time_s, horizon_s).min(axis=0))

    def _can_go_on(self, time_s: float, bodies: Sequence[MovingBody]) -> bool:
        """Whether the rest of the way is still free, and fresh or at its end."""
        if self._curve is None or self._escapes:
            return False
        if time_s - self._planned_s > self.settings.replan_every_s and not self.arrived:
            return False
        ahead = int(np.searchsorted(self._lengths, self._at_m, side="right")) - 1
        rest = replace(self._curve, path=DecodedPath(self._curve.path.poses[ahead:], self._curve.path.progress[ahead:]))
        wanted = self.planner.settings.constraint.clearance_m
        return self.planner.clearance(self.query, rest, bodies, time_s) >= wanted

    def _query_from(self, node: int) -> Query:
        query = self.query
        ends = PosePath(
            np.concatenate([self.pose.position_m, query.ends.position_m[1:]]),
            np.concatenate([self.pose.orientation, query.ends.orientation[1:]]),
        )
        return replace(query, start=node, ends=ends)

    def _take(self, curve: FittedCurve, escapes: bool) -> None:
        """Go on along a curve, from where it is nearest."""
        self._curve, self._escapes = curve, escapes
        poses = curve.path.poses
        turns = 2 * np.linalg.norm(np.diff(poses.orientation, axis=0), axis=1)
        steps = np.hypot(np.linalg.norm(np.diff(poses.position_m, axis=0), axis=1), LEVER_M * turns)
        self._lengths = np.concatenate([[0.0], np.cumsum(steps)])
        self._at_m = float(self._lengths[np.linalg.norm(curve.codes - self.code, axis=1).argmin()])
        self._step_aside, self._blended_m = vectors(self.pose)[0] - self._on_curve()[0], 0.0

    def _progress(self) -> float:
        assert self._curve is not None
        return float(np.interp(self._at_m, self._lengths, self._curve.path.progress))

    def _move(self) -> None:
        assert self._curve is not None
        fading = max(0.0, 1 - self._blended_m / BLEND_M)
        moved = self._on_curve() + fading * self._step_aside
        self.pose = of_vectors(moved, self.query.ends.position_m.shape[1])
        self.code = self._along(self._curve.codes)[0]

    def _on_curve(self) -> Float[np.ndarray, "1 D"]:
        assert self._curve is not None
        return self._along(vectors(self._curve.path.poses))

    def _along(self, values: Float[np.ndarray, "point k"]) -> Float[np.ndarray, "1 k"]:
        return np.array([[np.interp(self._at_m, self._lengths, axis) for axis in values.T]])


def _looking_ahead(planner: Planner, share: float) -> Planner:
    """The same planner, on the same graph, with a share of its horizon."""
    constraint = planner.settings.constraint
    nearer = copy(planner)
    nearer.settings = replace(planner.settings, constraint=replace(constraint, horizon_s=share * constraint.horizon_s))
    return nearer
