"""Shortest paths on a decoded latent grid whose weights change only where an obstacle is felt."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse.csgraph import dijkstra

from geomotion.errors import ShapeMismatch
from geomotion.manifolds.grid import LatentGrid
from geomotion.manifolds.lattice import BoxedEdges, Lattice, ListedEdges

WIDENINGS = (1.0, 1.5, 3.0)  # of the last path's cost: within them the search is tried before it is let free
ROUNDING = 1e-9  # relative; a path is found again under its own cost as limit


@dataclass(frozen=True)
class GraphPath:
    """A shortest path.

    Attributes:
        nodes: Numbers of its nodes, from start to goal.
        cost: Sum of its weights; infinite if there is no path, and `nodes` is then empty.
    """

    nodes: Int[np.ndarray, " node"]
    cost: float

    @property
    def exists(self) -> bool:
        """Whether start and goal are connected."""
        return bool(np.isfinite(self.cost))


class GeodesicGraph:
    r"""Grid graph weighted by Riemannian lengths of its edges, Sec. 3.5.4.

    An edge from i to j has the weight

    .. math:: \tfrac{f_i + f_j}{2} \sqrt{\sum_b \tfrac{m_{b,i} + m_{b,j}}{2} \|\Delta F_b\|^2 + \|\Delta F_o\|^2}

    with the chord ΔF of the decoded embedding (one block for each point that obstacles act on: the end effector, or
    points of the whole body, Eq. (4.4); and one block for all other coordinates), the conformal factor f and the
    obstacles' ambient factors m. Chords are more exact than products with the metric at nodes, above all where the
    spread rises like a wall. An edge is closed where an obstacle might touch it: with the room s of a node (its
    distance to the obstacles less the wanted clearance) and the travel L between two nodes, every point of the edge
    keeps a room of at least (s_i + s_j - L) / 2, because distances are 1-Lipschitz.

    Args:
        grid: Latent nodes and their neighbours.
        position: Embedded positions, one row a node, in blocks.
        rest: Other embedded coordinates, one row a node.
        conformal: f of each node.
        travel_m: Upper bound on how far any point of interest moves along each edge [m].

    Raises:
        ShapeMismatch: If an array has not one row a node, or `travel_m` not one a edge.
    """

    def __init__(
        self,
        grid: LatentGrid,
        position: Float[np.ndarray, "node B P"],
        rest: Float[np.ndarray, "other_node Q"],
        conformal: Float[np.ndarray, " another_node"],
        travel_m: Float[np.ndarray, " edge"],
    ) -> None:
        count, self.edges = grid.points_per_axis**grid.dim, grid.edges
        for name, values, rows in (
            ("position", position, count), ("rest", rest, count), ("conformal", conformal, count),
            ("travel_m", travel_m, len(self.edges)),
        ):  # fmt: skip
            if len(values) != rows:
                raise ShapeMismatch(f"{name} of a geodesic graph", f"{rows} rows", len(values))
        ends = self.edges.T
        self._position = [_squared_chords(block, ends) for block in np.moveaxis(position, 1, 0)]
        self._moving = [number for number, chords in enumerate(self._position) if chords.any()]
        self._rest = _squared_chords(rest, ends)
        self._stretch = conformal[ends].mean(axis=0)
        self._free = self._stretch * np.sqrt(sum(self._position, self._rest))  # without obstacles
        self.travel_m = np.asarray(travel_m, dtype=float)
        self._lattice = Lattice(grid)
        self._factor, self._room = np.ones((len(self._position), count)), np.full(count, np.inf)
        self._open = np.ones(count, dtype=bool)
        self._felt = np.zeros(0, dtype=np.intp)  # nodes that obstacles changed last time
        self._touched: tuple[Int[np.ndarray, " node"], list[BoxedEdges | ListedEdges]] | None = None
        self._is_soft = False  # whether a factor is not one
        self._goal: int | None = None
        self._ahead = np.zeros(count)  # least cost to this goal without obstacles; zero without a goal
        self.weights = np.empty(len(self.edges))
        self._update(self._lattice.everywhere())

    @property
    def factor(self) -> Float[np.ndarray, "B node"]:
        """Ambient factors of the obstacles felt now, of each block."""
        return self._factor

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return len(self._room)

    @property
    def memory_bytes(self) -> int:
        """Bytes of all arrays held here."""
        matrix = self._lattice.matrix
        held = [value for value in vars(self).values() if isinstance(value, np.ndarray)]
        held += [*self._position, matrix.data, matrix.indices, matrix.indptr, self._lattice.incident]
        return sum(value.nbytes for value in held)

    def close(self, closed: Bool[np.ndarray, " node"]) -> None:
        """Leave nodes out of every path; the others are open again."""
        if not (self._open == closed).any():
            return
        self._open, self._goal, self._ahead = ~closed, None, np.zeros(self.nodes)
        self._touched = None
        self._update(self._lattice.everywhere())

    def set_travel(self, travel_m: Float[np.ndarray, " edge"]) -> None:
        """Change how far points of interest move along each edge [m]: another tool, another place of the skill."""
        self.travel_m = np.asarray(travel_m, dtype=float)
        self._update(self._lattice.touching(self._felt))

    def feel(
        self,
        nodes: Int[np.ndarray, " felt"],
        factor: Float[np.ndarray, "B felt"],
        room_m: Float[np.ndarray, " felt"],
    ) -> None:
        """Put obstacles where they are now; every other node is freed of where they were.

        Args:
            nodes: Nodes in their reach. Nodes left out must have room for all their edges.
            factor: m of Eq. (3.15) there, of each block.
            room_m: Distance to the nearest obstacle less the wanted clearance there [m].
        """
        self._room[self._felt] = np.inf
        self._room[nodes] = room_m
        becomes_soft = bool((np.asarray(factor) != 1).any())
        if self._is_soft or becomes_soft:
            self._factor[:, self._felt] = 1.0
            self._factor[:, nodes] = factor
        touched = np.concatenate([self._felt, nodes])
        self._felt, self._is_soft = np.asarray(nodes, dtype=np.intp), self._is_soft or becomes_soft
        self._update(self._open_edges(touched))
        self._is_soft = becomes_soft

    def shut(self, nodes: Int[np.ndarray, " some"]) -> None:
        """Leave further nodes out of every path until obstacles are put anew."""
        self._room[nodes] = -np.inf
        self._felt = np.union1d(self._felt, nodes)
        self._update(self._lattice.touching(np.asarray(nodes, dtype=np.intp)))

    def is_clear(self, nodes: Int[np.ndarray, " some"]) -> Bool[np.ndarray, " some"]:
        """Whether nodes are outside what obstacles take."""
        return np.asarray(self._room[nodes] >= 0)

    def is_free(self, nodes: Int[np.ndarray, " some"]) -> Bool[np.ndarray, " some"]:
        """Whether nodes are open and outside what obstacles take."""
        return np.asarray(self._open[nodes] & (self._room[nodes] >= 0))

    def shortest_path(self, start: int, goal: int, guess: GraphPath | None = None) -> GraphPath:
        """Dijkstra's shortest path.

        Args:
            start: Node.
            goal: Node.
            guess: A path to the same goal, for example under other obstacles. The search then heads for the goal and,
                if the start is the same, is bounded by the guess' cost under the present weights; it stays exact.
        """
        adds = self._factor[:, self._felt].min(initial=1.0) >= 1  # else what is left to the goal is no lower bound
        if guess is None or len(guess.nodes) == 0 or guess.nodes[-1] != goal or not adds:
            self._head_for(None)
            return self._search(start, goal, np.inf)
        self._head_for(goal)
        is_same = guess.nodes[0] == start
        bound, likely = (self.cost(guess.nodes), guess.cost) if is_same else (np.inf, self._ahead[start])
        limits = [*(limit for limit in likely * np.array(WIDENINGS) if limit < bound), bound]
        for limit in limits:
            found = self._search(start, goal, max(limit * (1 + ROUNDING) - self._ahead[start], 0.0))
            if found.exists:
                break
        return found

    def costs_from(self, start: int) -> Float[np.ndarray, " node"]:
        """Cost of the shortest path from one node to every other."""
        self._head_for(None)
        return np.asarray(dijkstra(self._lattice.matrix, directed=True, indices=start))

    def cost(self, nodes: Int[np.ndarray, " node"]) -> float:
        """Sum of the weights along nodes; infinite where two in a row are not neighbours."""
        incident, onward = self._lattice.incident[nodes[:-1]], self._lattice.neighbours(nodes[:-1])
        joins = (onward == nodes[1:, None]) & (incident < len(self.weights))
        along = self.weights[incident[joins]].tolist()
        return float(sum(along)) if joins.any(axis=1).all() else np.inf  # one by one, as Dijkstra's algorithm adds

    def _search(self, start: int, goal: int, limit: float) -> GraphPath:
        matrix = self._lattice.matrix
        costs, before = dijkstra(matrix, directed=True, indices=start, return_predecessors=True, limit=limit)
        if not np.isfinite(costs[goal]):
            return GraphPath(np.zeros(0, dtype=np.intp), np.inf)
        nodes = [goal]
        while nodes[-1] != start:
            nodes.append(int(before[nodes[-1]]))
        found = np.array(nodes[::-1], dtype=np.intp)
        return GraphPath(found, self.cost(found))

    def _head_for(self, goal: int | None) -> None:
        r"""Direct the search by what is left to the goal without obstacles, h: A* as Dijkstra on other weights.

        An edge from i to j counts as :math:`w_{ij} - h_i + h_j`, which obstacles keep from being negative, because they
        only add to the metric. Every path to the goal is then shorter by the h of its start.

        Source: Hart, Nilsson, Raphael (1968), A formal basis for the heuristic determination of minimum cost paths.
        """
        if goal == self._goal:
            return
        self._goal, self._ahead = goal, np.zeros(self.nodes)
        if goal is not None:
            self._direct(np.where(self._open[self.edges].all(axis=1), self._free, np.inf))
            costs = dijkstra(self._lattice.matrix, directed=True, indices=goal)
            self._ahead = np.where(np.isfinite(costs), costs, 0.0)
        self._direct(self.weights)

    def _direct(self, weights: Float[np.ndarray, " edge"]) -> None:
        for edges in self._lattice.everywhere():
            self._store(edges, edges.of(weights))

    def _store(self, edges: BoxedEdges | ListedEdges, weights: Float[np.ndarray, "..."]) -> None:
        first, second = edges.ends(self._ahead)
        gain = second - first
        edges.direct(self._lattice.matrix.data, np.maximum(weights + gain, 0), np.maximum(weights - gain, 0))

    def _under_factors(self, edges: BoxedEdges | ListedEdges) -> Float[np.ndarray, "..."]:
        squares = edges.of(self._rest)
        for block in self._moving:
            first, second = edges.ends(self._factor[block])
            mean = first + second
            mean /= 2
            mean *= edges.of(self._position[block])
            squares = np.add(squares, mean, out=mean)
        return np.asarray(edges.of(self._stretch) * np.sqrt(squares))

    def _open_edges(self, nodes: Int[np.ndarray, " some"]) -> list[BoxedEdges | ListedEdges]:
        """Edges at nodes, listed ones only if both ends are open; the same ones again while the nodes are the same."""
        is_meant = np.zeros(self.nodes, dtype=bool)
        is_meant[nodes] = True
        meant = np.flatnonzero(is_meant)
        if self._touched is None or not np.array_equal(self._touched[0], meant):
            edges = [
                one.only(np.logical_and(*one.ends(self._open))) if isinstance(one, ListedEdges) else one
                for one in self._lattice.touching(meant)
            ]
            self._touched = meant, edges
        return self._touched[1]

    def _update(self, touched: Iterable[BoxedEdges | ListedEdges]) -> None:
        """Weigh some edges anew."""
        for edges in touched:
            weights = self._under_factors(edges) if self._is_soft else edges.of(self._free).copy()
            room, other = edges.ends(self._room)
            opened, other_opened = edges.ends(self._open)
            with np.errstate(invalid="ignore"):  # -∞ of a shut node and ∞ of a free one: not enough
                weights[~(opened & other_opened & (room + other >= edges.of(self.travel_m)))] = np.inf
            if isinstance(edges, ListedEdges):  # in no order, so that storing them costs more than looking which differ
                is_new = weights != edges.of(self.weights)
                edges, weights = edges.only(is_new), weights[is_new]
            edges.put(self.weights, weights)
            self._store(edges, weights)


def _squared_chords(
    embedded: Float[np.ndarray, "node k"], ends: Int[np.ndarray, "2 edge"]
) -> Float[np.ndarray, " edge"]:
    """Axis by axis: all at once, the differences alone would be the largest array of the graph."""
    squares = np.zeros(ends.shape[1])
    for axis in embedded.T:
        values = axis[ends]
        squares += np.square(values[1] - values[0])
    return squares
