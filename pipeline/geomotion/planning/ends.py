"""Where a motion starts and ends on a decoded grid, and the grid carried there."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from geomotion.manifolds.graph import GeodesicGraph
from geomotion.planning.carrying import Offsets
from geomotion.planning.manifold import Codes, SkillManifold, Surface
from geomotion.planning.obstruction import Balls, RobotShape
from geomotion.scores.paths import MotionPath

NOTHING = np.zeros(0, dtype=np.intp), np.zeros((1, 0)), np.zeros(0)  # felt by any number of blocks


@dataclass(frozen=True)
class Anchors:
    """Where the demonstrations of each group begin or end.

    Attributes:
        codes: Their mean latent point for each group, shape (group, d).
        states: What these decode to.
        radii: Largest distance of a demonstrated end from that state, in units of the manifold's scale, for each group.
    """

    codes: Codes
    states: MotionPath
    radii: Float[np.ndarray, " group"]


@dataclass(frozen=True)
class Query:
    """Start and goal with the surface carried there: everything that obstacles do not change.

    Attributes:
        start: Node.
        goal: Node.
        offsets: What carries the skill to the wanted states.
        ends: The wanted states.
        states: Carried states of all nodes.
        is_within: Nodes that are near enough to the demonstrations, and where the robot can be.
        is_open: Those of them that paths may use: through the others, any path is so long that it crosses a region
            without data.
        nodes: Numbers of the open ones.
        balls: Of the robot's shape there.
        travel_m: How far a ball moves along each edge between them, at most [m]; 0 where it is not looked at.
        longest_travel_m: The largest of these [m].
    """

    start: int
    goal: int
    offsets: Offsets
    ends: MotionPath
    states: MotionPath
    is_within: Bool[np.ndarray, " node"]
    is_open: Bool[np.ndarray, " node"]
    nodes: Int[np.ndarray, " open"]
    balls: Balls
    travel_m: Float[np.ndarray, " edge"]
    longest_travel_m: float


class Ends:
    """Finds the nodes of wanted states.

    Args:
        manifold: Decoder.
        surface: Its decoded grid.
        starts: Where demonstrations begin.
        goals: Where they end.
        shape: What must not touch obstacles.
        is_within: Nodes that are no farther from the demonstrations than allowed.
        closes_edges: Whether the travel along edges is taken into account.
        crossing_length: Length, in the thesis' metric, above which a path crosses a region without data.
    """

    def __init__(
        self,
        manifold: SkillManifold,
        surface: Surface,
        starts: Anchors,
        goals: Anchors,
        shape: RobotShape,
        is_within: Bool[np.ndarray, " node"],
        closes_edges: bool,
        crossing_length: float,
    ) -> None:
        self.manifold, self.surface, self.shape = manifold, surface, shape
        self._anchors, self._is_within = (starts, goals), is_within
        self._closes_edges, self._crossing_length = closes_edges, crossing_length

    def query(
        self, graph: GeodesicGraph, start: MotionPath, goal: MotionPath, codes: tuple[Codes | None, Codes | None]
    ) -> Query:
        """Find both nodes and carry the surface there.

        Args:
            graph: In which the goal has to be reached from the start.
            start: One state.
            goal: One state.
            codes: Latent points of start and goal, shape (1, d), where they are known.
        """
        is_within = self._is_within.copy()
        first = self._node(start, codes[0], self._anchors[0])
        is_within[first] = True
        graph.close(~is_within)
        graph.feel(*NOTHING)
        last = self._node(goal, codes[1], self._anchors[1], graph, first)
        is_within[last] = True
        decoded = self.surface.decoded
        ends = self.joined(start, goal, np.array([first, last]))
        offsets = Offsets.between(decoded.states, ends, decoded.progress, (first, last))
        states = offsets.carry(decoded.states, decoded.progress)
        is_within &= self.manifold.allows(states)
        is_open = is_within & self._is_on_the_way(first, last)
        nodes = np.flatnonzero(is_open)
        edges = self.surface.grid.edges
        between = is_open[edges].all(axis=1)
        travel = np.zeros(len(edges))
        if self._closes_edges:
            travel[between] = self.shape.travel_m(states, edges[between])
        balls = Balls(self.shape.points(states.with_vectors(states.vectors[nodes])), self.shape)
        longest = float(travel.max(initial=0.0))
        return Query(first, last, offsets, ends, states, is_within, is_open, nodes, balls, travel, longest)

    def _is_on_the_way(self, start: int, goal: int) -> Bool[np.ndarray, " node"]:
        """Nodes that some path visits which does not cross a region without data.

        No way to a node is shorter than the chord in the space that the metric is pulled back from.
        """
        embedded = self.surface.columns[:, :-1]
        there, back = (np.linalg.norm(embedded - embedded[end], axis=1) for end in (start, goal))
        on_the_way = there + back <= self._crossing_length
        on_the_way[[start, goal]] = True
        return np.asarray(on_the_way)

    def onward(self, query: Query, node: int, state: MotionPath | None = None) -> Query:
        """The same query from a node on the way, at the state of the robot; at that of the node if omitted."""
        here = query.states[node : node + 1] if state is None else state
        return replace(query, start=node, ends=self.joined(here, query.ends, np.array([node, query.goal])))

    def joined(self, start: MotionPath, goal: MotionPath, nodes: Int[np.ndarray, " end"]) -> MotionPath:
        """First and last state, written as the surface has them at some nodes."""
        decoded = self.surface.decoded.states
        ends = start.with_vectors(np.concatenate([start.vectors[:1], goal.vectors[-1:]]))
        return ends.with_signs_of(decoded.with_vectors(decoded.vectors[nodes]))

    def _node(
        self,
        state: MotionPath,
        code: Codes | None,
        anchors: Anchors,
        graph: GeodesicGraph | None = None,
        reached_from: int = 0,
    ) -> int:
        """The node of a known code, else of an anchor that is as near as demonstrations are, else the nearest."""
        if code is not None:
            return int(self.surface.grid.nearest(code)[0])
        apart = self.manifold.separation(anchors.states, state)
        nearest = int((apart / np.maximum(anchors.radii, np.finfo(float).tiny)).argmin())
        if apart[nearest] <= anchors.radii[nearest]:
            return int(self.surface.grid.nearest(anchors.codes[nearest : nearest + 1])[0])
        apart = np.where(self._is_within, self.manifold.separation(self.surface.decoded.states, state), np.inf)
        if graph is None or not np.isfinite(apart.min()):
            return int(apart.argmin())
        connected = np.isfinite(graph.costs_from(reached_from))
        among = np.where(connected, apart, np.inf)
        return int(among.argmin()) if among.min() <= 2 * apart.min() + self.cell_size() else int(apart.argmin())

    def cell_size(self) -> float:
        """Median distance between the end effectors of neighbouring open nodes, in units of the manifold's scale."""
        edges = self.surface.grid.edges[self._is_within[self.surface.grid.edges].all(axis=1)]
        positions_m = self.surface.decoded.states.position_m
        steps = positions_m[edges[:, 1]] - positions_m[edges[:, 0]]
        return float(np.median(np.linalg.norm(steps, axis=1)) / self.manifold.scale_m) if len(edges) else 0.0
