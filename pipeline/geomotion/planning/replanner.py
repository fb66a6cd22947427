"""Replanning while a robot moves: the decoded graph stays, obstacles touch only what is in their reach."""

from collections.abc import Sequence

import numpy as np

from geomotion.manifolds.graph import GraphPath
from geomotion.obstacles.motion import MovingBody
from geomotion.planning.curve import FittedCurve
from geomotion.planning.ends import Query
from geomotion.planning.planner import Planner
from geomotion.scores.paths import MotionPath


class Replanner:
    """Answers, each time a control loop asks, with the path from where the robot is.

    Args:
        planner: Plans on the decoded graph.
        start: Where the motion begins.
        goal: Where it ends.
    """

    def __init__(self, planner: Planner, start: MotionPath, goal: MotionPath) -> None:
        self.planner, self.goal = planner, goal
        self.query: Query = planner.query(start, goal)
        self._last: GraphPath | None = None

    def replan(
        self, bodies: Sequence[MovingBody], time_s: float, at: int | None = None, state: MotionPath | None = None
    ) -> FittedCurve | None:
        """The path among obstacles as they are now; nothing where every way is blocked.

        Args:
            bodies: Obstacles.
            time_s: When they are looked at.
            at: Node to start from; the query's own if omitted.
            state: The robot's, near that node, so that the path begins there; the state of the node if omitted.
        """
        query = self.query if at is None else self.planner.ends.onward(self.query, at, state)
        route = self.planner.route(query, bodies, time_s, self._rest_from(query.start), closely=False)
        self._last = self._last if route is None else route.found
        return None if route is None else route.curve

    def node_at(self, code: np.ndarray) -> int:
        """The node nearest to a latent point, shape (d,), of the last path."""
        return int(self.planner.surface.grid.nearest(code[None])[0])

    def _rest_from(self, node: int) -> GraphPath | None:
        """What is left of the last path where the node is on it; elsewhere all of it, which still leads to the goal."""
        if self._last is None or node not in self._last.nodes:
            return self._last
        place = np.flatnonzero(self._last.nodes == node)
        rest = self._last.nodes[place[0] :]
        return GraphPath(rest, self.planner.graph.cost(rest))
