"""What there is to see of a planned motion."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from geomotion.figures.joints import JointAxes
from geomotion.figures.latent import LatentMaps
from geomotion.scores.paths import MotionPath

PROJECTIONS = ((0, 1), (0, 2), (1, 2))
FLAT_M = 1e-6  # extent of positions along an axis below which they lie in a plane across it

ArmPoses = Float[np.ndarray, "pose point D"]
"""Joint origins and tip of an arm in some of its configurations, in the order in which links join them [m]."""


@dataclass(frozen=True)
class ObstacleShape:
    """Surface of an obstacle.

    Attributes:
        name: Of the obstacle.
        vertices: At time zero, in the robot's frame [m]; for planar data an outline.
        faces: Numbers of the vertices of each triangle; empty for an outline.
        way: Displacements over time [m]; one row of zeros if it rests.
    """

    name: str
    vertices: Float[np.ndarray, "vertex D"]
    faces: Int[np.ndarray, "face _"]
    way: Float[np.ndarray, "place D"]

    @property
    def moves(self) -> bool:
        """Whether it is ever elsewhere."""
        return bool(np.ptp(self.way, axis=0).any())

    def polygons(self, plane: tuple[int, int], place: int) -> list[Float[np.ndarray, "_ 2"]]:
        """Its outline, or its triangles projected to a plane [m]; `place` numbers the rows of its way."""
        seen = (self.vertices + self.way[place])[:, plane]
        return list(seen[self.faces]) if len(self.faces) else [seen]


@dataclass(frozen=True)
class DrawnArm:
    """An arm whose configurations are planned.

    Attributes:
        joints: Its joints.
        along: Some poses along each leg.
        demonstrated: Some poses along one demonstration of each group, by group.
    """

    joints: JointAxes
    along: list[ArmPoses]
    demonstrated: dict[int, ArmPoses]


@dataclass(frozen=True)
class PlanPicture:
    """What there is to see of a plan; lists of legs are empty where no path was found.

    Attributes:
        maps: The latent plane or space.
        codes: Latent path of each leg, of shape (n, d); a leg that begins where the one before ends goes on with it.
        line: Straight latent line of each leg, of shape (n, d).
        closed: Nodes that obstacles take; None without obstacles.
        demonstrations: All of them.
        held_out: Numbers of those kept from training.
        groups: Group of each demonstration.
        paths: Decoded legs.
        line_paths: Decoded straight line of each leg.
        obstacles: Obstacles.
        arm: The arm, if the paths are of its configurations.
    """

    maps: LatentMaps
    codes: list[Float[np.ndarray, "_ _"]]
    line: list[Float[np.ndarray, "_ _"]]
    closed: Bool[np.ndarray, "*shape"] | None
    demonstrations: list[MotionPath]
    held_out: list[int]
    groups: list[int]
    paths: list[MotionPath]
    line_paths: list[MotionPath]
    obstacles: list[ObstacleShape]
    arm: DrawnArm | None = None

    @property
    def planes(self) -> tuple[tuple[int, int], ...]:
        """Pairs of axes in which positions are drawn."""
        return planes_of(self.demonstrations)

    @property
    def runs(self) -> list[list[int]]:
        """Numbers of legs, together where one goes on with the one before."""
        return in_a_row([path.position_m for path in self.paths])

    @property
    def orientation_dim(self) -> int:
        """Four for quaternions, three for directions."""
        return int(self.demonstrations[0].orientation.shape[1])

    @property
    def shows_arm(self) -> bool:
        """Whether projections show the arm along the path.

        One that moves in a plane always is (Fig. 4.1), others among obstacles: links make the paths of tools small.
        """
        return self.arm is not None and bool(self.arm.along) and (len(self.planes) == 1 or bool(self.obstacles))

    @property
    def has_closed(self) -> bool:
        """Whether obstacles take any node."""
        return self.closed is not None and bool(self.closed.any())


def planes_of(paths: Sequence[MotionPath]) -> tuple[tuple[int, int], ...]:
    """Pairs of axes of space; the only one in which paths move, where they stay in a plane across an axis."""
    extent = np.ptp(np.concatenate([path.position_m for path in paths]), axis=0)
    flat = {int(axis) for axis in np.flatnonzero(extent < FLAT_M)} | set(range(len(extent), 3))
    within = tuple(plane for plane in PROJECTIONS if not flat & set(plane))
    return within or tuple(plane for plane in PROJECTIONS if max(plane) < len(extent))


def in_a_row(legs: Sequence[Float[np.ndarray, "_ _"]]) -> list[list[int]]:
    """Numbers of legs, together where each begins at the end of the one before."""
    runs: list[list[int]] = []
    for number, leg in enumerate(legs):
        if number and np.allclose(legs[number - 1][-1], leg[0]):
            runs[-1].append(number)
        else:
            runs.append([number])
    return runs
