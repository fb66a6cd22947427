"""How far poses are from the demonstrated ones."""

from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.scores.paths import QUATERNION, MotionPath, Positions

NEIGHBOURS = 20  # demonstrated poses nearest in position, whose orientations are looked at
LEAF = 32  # poses; for thousands of queries in a row faster than the usual 16


@runtime_checkable
class Support(Protocol):
    """Demonstrated states, ready for many queries."""

    def distances(self, path: MotionPath) -> tuple[Float[np.ndarray, " state"], Float[np.ndarray, " state"]]:
        """How far the end effector [m] and the angles [rad] of states are from demonstrated ones."""
        ...

    def share_within(self, position_m: Positions, radius_m: float) -> float:
        """Share of the end effector's positions with a demonstrated one no farther than a radius."""
        ...


class PoseSupport:
    """The demonstrated poses, ready for many queries.

    Args:
        position_m: Demonstrated positions [m].
        orientation: Demonstrated unit quaternions wxyz, of either sign, or unit vectors in space.

    Raises:
        ShapeMismatch: If they differ in number.
    """

    def __init__(self, position_m: Positions, orientation: Float[np.ndarray, "other_pose Dq"]) -> None:
        if len(position_m) != len(orientation):
            raise ShapeMismatch("orientations of demonstrated poses", len(position_m), len(orientation))
        self.tree = cKDTree(position_m, leafsize=LEAF)
        self.orientation = orientation

    @classmethod
    def of(cls, demonstrations: Sequence[MotionPath]) -> "PoseSupport":
        """All poses of some demonstrations."""
        return cls(
            np.concatenate([demo.position_m for demo in demonstrations]),
            np.concatenate([demo.orientation for demo in demonstrations]),
        )

    def distances(self, path: MotionPath) -> tuple[Float[np.ndarray, " pose"], Float[np.ndarray, " pose"]]:
        """Distance to the nearest demonstrated position [m], and smallest angle to the orientations around it [rad].

        These are the orientations of the 20 poses nearest in position: the angle to a pose that is near in position,
        not to one that occurs elsewhere.
        """
        count, orientation = min(NEIGHBOURS, self.tree.n), path.orientation
        distances, index = self.tree.query(path.position_m, k=np.arange(1, count + 1))
        cosines = np.einsum("pd,pkd->pk", orientation, self.orientation[index])
        if orientation.shape[1] == QUATERNION:
            return distances[:, 0], 2 * np.arccos(np.minimum(np.abs(cosines).max(axis=1), 1))
        return distances[:, 0], np.arccos(cosines.max(axis=1).clip(-1, 1))

    def share_within(self, position_m: Positions, radius_m: float) -> float:
        """Share of the positions with a demonstrated one no farther than a radius."""
        distances, _ = self.tree.query(position_m)
        return float((distances <= radius_m).mean())


def leave_one_out(
    demonstrations: Sequence[MotionPath], support_of: Callable[[Sequence[MotionPath]], Support] = PoseSupport.of
) -> tuple[Float[np.ndarray, " demo"], Float[np.ndarray, " demo"]]:
    """How far each demonstration goes from all the others: its farthest state in position [m] and angle [rad].

    Raises:
        InvalidSetting: If there is only one.
    """
    if len(demonstrations) < 2:
        raise InvalidSetting("demonstrations", len(demonstrations), "two or more, to compare one with the others")
    farthest = []
    for left_out, demo in enumerate(demonstrations):
        others = [other for index, other in enumerate(demonstrations) if index != left_out]
        apart_m, apart_rad = support_of(others).distances(demo)
        farthest.append((apart_m.max(), apart_rad.max()))
    in_m, in_rad = np.array(farthest).T
    return in_m, in_rad
