"""The edges of a grid where weights change: as slices of arrays around many nodes, as lists of numbers at a few."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Int, Shaped
from scipy.sparse import csr_array

from geomotion.manifolds.grid import LatentGrid

Part = tuple[slice, ...]
Values = Shaped[np.ndarray, "..."]
FULL_BOX = 1.0  # nodes in a box for each one that is named, up to which slices of the whole box are faster


@dataclass(frozen=True)
class BoxedEdges:
    """Edges along one step at a box of nodes.

    Attributes:
        grid: Number of nodes along each axis.
        first: Where their first ends are in an array of that shape.
        second: Where their second ends are.
        numbers: Numbers of all edges along this step.
        extent: Of the box that the first ends of all these make.
        part: Which of that box are meant.
        columns: Their entries in the rows of the matrix, from the first end and from the second.
    """

    grid: tuple[int, ...]
    first: Part
    second: Part
    numbers: slice
    extent: tuple[int, ...]
    part: Part
    columns: tuple[int, int]

    def ends(self, values: Shaped[np.ndarray, " node"]) -> tuple[Values, Values]:
        """Values of nodes at the first and at the second ends."""
        shaped = values.reshape(self.grid)
        return shaped[self.first], shaped[self.second]

    def of(self, values: Shaped[np.ndarray, " edge"]) -> Values:
        """Their values among those of all edges."""
        return values[self.numbers].reshape(self.extent)[self.part]

    def put(self, values: Shaped[np.ndarray, " edge"], new: Values) -> None:
        """Set their values among those of all edges."""
        self.of(values)[...] = new

    def direct(self, entries: Shaped[np.ndarray, " entry"], there: Values, back: Values) -> None:
        """Set the entries of the matrix from first to second ends, and back."""
        shaped = entries.reshape(*self.grid, -1)
        shaped[..., self.columns[0]][self.first] = there
        shaped[..., self.columns[1]][self.second] = back


@dataclass(frozen=True)
class ListedEdges:
    """Any edges; what can be done with them is as with :class:`BoxedEdges`.

    Attributes:
        numbers: Their numbers.
        first: Nodes at their first ends.
        second: Nodes at their second ends.
        there: Places of their entries in the matrix, from the first end.
        back: The same from the second.
    """

    numbers: Int[np.ndarray, " edge"]
    first: Int[np.ndarray, " edge"]
    second: Int[np.ndarray, " edge"]
    there: Int[np.ndarray, " edge"]
    back: Int[np.ndarray, " edge"]

    def ends(self, values: Shaped[np.ndarray, " node"]) -> tuple[Values, Values]:
        return values[self.first], values[self.second]

    def of(self, values: Shaped[np.ndarray, " every_edge"]) -> Values:
        return np.asarray(values[self.numbers])

    def put(self, values: Shaped[np.ndarray, " every_edge"], new: Values) -> None:
        values[self.numbers] = new

    def only(self, which: Bool[np.ndarray, " edge"]) -> "ListedEdges":
        """Some of them."""
        some = np.flatnonzero(which)
        return ListedEdges(*(getattr(self, one.name)[some] for one in fields(self)))

    def direct(self, entries: Shaped[np.ndarray, " entry"], there: Values, back: Values) -> None:
        entries[self.there], entries[self.back] = there, back


class Lattice:
    """A grid's edges in the order of :attr:`LatentGrid.edges`, and both directions of them as a sparse matrix.

    Args:
        grid: Nodes.

    Attributes:
        matrix: Every row has one entry for each step and its opposite; where the grid ends, an infinite one to itself.
        incident: Number of the edge behind each entry; the number after the last edge where there is none.
    """

    def __init__(self, grid: LatentGrid) -> None:
        self.shape, self.steps, self._edges = grid.shape, grid.steps, grid.edges
        extents = [tuple(n - abs(one) for n, one in zip(self.shape, step, strict=True)) for step in self.steps]
        self._begins = np.cumsum([0, *map(math.prod, extents)])
        strides = np.cumprod([1, *self.shape[:0:-1]])[::-1]
        self._offsets = np.array(self.steps) @ strides  # from the number of an edge's first end to that of its second
        count, width = math.prod(self.shape), 2 * len(self.steps)
        nodes = np.arange(count, dtype=np.int32)
        columns, incident = np.repeat(nodes, width), np.full(count * width, len(self._edges), dtype=np.int32)
        numbers = np.arange(len(self._edges), dtype=np.int32)
        for edges in self.everywhere():
            first, second = edges.ends(nodes)
            edges.direct(columns, second, first)
            edges.direct(incident, edges.of(numbers), edges.of(numbers))
        rows = np.arange(0, count * width + 1, width, dtype=np.int32)
        self.matrix = csr_array((np.full(columns.size, np.inf), columns, rows), shape=(count, count))
        self.incident: Int[np.ndarray, "node entry"] = incident.reshape(count, width)

    def everywhere(self) -> Iterator[BoxedEdges]:
        """All edges, step by step."""
        return self._boxes((0,) * len(self.shape), self.shape)

    def touching(self, nodes: Int[np.ndarray, " some"]) -> Iterator[BoxedEdges | ListedEdges]:
        """All edges at these nodes, and perhaps some near them."""
        if len(nodes) == 0:
            return
        axes = np.unravel_index(nodes, self.shape)
        low, high = tuple(int(axis.min()) for axis in axes), tuple(int(axis.max()) + 1 for axis in axes)
        if math.prod(np.subtract(high, low).tolist()) <= FULL_BOX * len(nodes):
            yield from self._boxes(low, high)
        else:
            yield self._listed(nodes)

    def neighbours(self, nodes: Int[np.ndarray, " some"]) -> Int[np.ndarray, "some entry"]:
        """What the entries of some rows lead to."""
        return np.asarray(self.matrix.indices.reshape(self.incident.shape)[nodes])

    def _boxes(self, low: tuple[int, ...], high: tuple[int, ...]) -> Iterator[BoxedEdges]:
        for column, step in enumerate(self.steps):
            first, second, part = [], [], []
            for one, count, begin, end in zip(step, self.shape, low, high, strict=True):
                lowest = max(0, -one)  # where the first ends of all edges along this step begin
                begin, end = max(lowest, begin - max(0, one)), min(count - max(0, one), end + max(0, -one))
                first.append(slice(begin, end))
                second.append(slice(begin + one, end + one))
                part.append(slice(begin - lowest, end - lowest))
            yield BoxedEdges(
                self.shape,
                tuple(first),
                tuple(second),
                slice(*self._begins[column : column + 2].tolist()),
                tuple(count - abs(one) for count, one in zip(self.shape, step, strict=True)),
                tuple(part),
                (column, column + len(self.steps)),
            )

    def _listed(self, nodes: Int[np.ndarray, " some"]) -> ListedEdges:
        """Step by step, the edges that begin at the nodes, and those that end there and begin elsewhere."""
        is_meant = np.zeros(len(self.incident), dtype=bool)
        is_meant[nodes] = True
        meant, count, last = np.flatnonzero(is_meant), len(self.steps), len(self._edges)
        incident = self.incident[meant]
        first = []
        for column, offset in enumerate(self._offsets):
            before = meant[incident[:, column + count] < last] - offset
            first.append(np.concatenate([meant[incident[:, column] < last], before[~is_meant[before]]]))
        columns = np.repeat(np.arange(count), [len(one) for one in first])
        begins = np.concatenate(first)
        ends = begins + self._offsets[columns]
        there, back = begins * 2 * count + columns, ends * 2 * count + columns + count
        return ListedEdges(self.incident.ravel()[there], begins, ends, there, back)
