"""Where a field is judged: points spread over the box around the demonstrations."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

Points = Float[np.ndarray, "point D"]

FLATTEST_AXIS = 0.01  # of the diagonal: a grid over demonstrations along one axis stays a grid


@dataclass(frozen=True)
class Box:
    """Axis-parallel box.

    Attributes:
        lower: Lowest corner, shape (D,) [m].
        upper: Highest corner, shape (D,) [m].
    """

    lower: Float[np.ndarray, " D"]
    upper: Float[np.ndarray, " D"]

    @property
    def dim(self) -> int:
        """D."""
        return len(self.lower)

    @property
    def diagonal(self) -> float:
        """Distance between the corners [m]."""
        return float(np.linalg.norm(self.upper - self.lower))

    def enlarged(self, margin: float) -> "Box":
        """With `margin` times its extent added on each side of each axis; no axis is left flat."""
        extent = np.maximum(self.upper - self.lower, FLATTEST_AXIS * self.diagonal)
        centre = (self.lower + self.upper) / 2
        reach = (0.5 + margin) * extent
        return Box(centre - reach, centre + reach)


def bounding_box(curves: Sequence[Float[np.ndarray, "_ D"]]) -> Box:
    """Smallest box around all points."""
    points = np.concatenate(curves)
    return Box(points.min(axis=0), points.max(axis=0))


@dataclass(frozen=True)
class Sample:
    """Points of a box, and how they were chosen.

    Attributes:
        points: Shape (point, D) [m].
        shape: (rows, columns) of an equidistant 2-D grid, row by row from the lowest corner, the first axis
            running along a row; empty for random points.
        note: The choice in words.
    """

    points: Points
    shape: tuple[int, ...]
    note: str


def sample_box(box: Box, points_per_axis: int, seed: int) -> Sample:
    """An equidistant grid in two dimensions; in any other, as many points drawn uniformly at random."""
    count = points_per_axis**2
    if box.dim == 2:
        axes = np.linspace(box.lower, box.upper, points_per_axis).T
        points = np.stack(np.meshgrid(*axes), axis=-1).reshape(count, 2)
        return Sample(
            points, (points_per_axis, points_per_axis), f"equidistant {points_per_axis} x {points_per_axis} grid"
        )
    points = np.random.default_rng(seed).uniform(box.lower, box.upper, size=(count, box.dim))
    return Sample(points, (), f"{count} random points, seed {seed}")
