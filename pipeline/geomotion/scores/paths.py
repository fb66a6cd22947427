"""Scores of paths of poses against demonstrations, in position [m] and in orientation [rad], and a baseline for them.

Orientations are unit quaternions, scalar first, of either sign, or unit vectors in space.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Float
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.scores.curves import dtwd_per_point

Positions = Float[np.ndarray, "pose Dx"]
Orientations = Float[np.ndarray, "pose Dq"]
QUATERNION, DIRECTION = 4, 3  # numbers of coordinates
LEVER_M = 0.1  # a radian of turning counts as that much in the length of a step
UNIT_TOLERANCE = 1e-3
P = TypeVar("P", bound="MotionPath")  # the kind of path it is


@runtime_checkable
class MotionPath(Protocol):
    """States of a robot in the order in which they are passed, at equal shares of the duration.

    As vectors they can be added up and interpolated, whatever they are: poses, or configurations of an arm.
    """

    @property
    def position_m(self) -> Positions:
        """Of the end effector [m]."""
        ...

    @property
    def orientation(self) -> Orientations:
        """Of the end effector: unit quaternions wxyz, or unit vectors in space."""
        ...

    @property
    def vectors(self) -> Float[np.ndarray, "state D"]:
        """One row for each state."""
        ...

    def with_vectors(self: P, values: Float[np.ndarray, "other_state D"]) -> P:
        """States of the same kind from their vectors, brought back to where such vectors have to lie."""
        ...

    def with_signs_of(self: P, known: P) -> P:
        """The same states, written such that their vectors are near those of known ones, row by row."""
        ...

    def resampled(self: P, count: int) -> P:
        """Interpolated at equal shares of the duration."""
        ...

    def residuals(self: P, other: P) -> tuple[Float[np.ndarray, " state"], Float[np.ndarray, " state"]]:
        """How far apart the end effector's positions [m] and the angles of the states [rad] are, row by row."""
        ...

    def steps_m(self) -> Float[np.ndarray, " step"]:
        """Lengths of the steps between states [m], angles counted by a lever."""
        ...

    def __len__(self) -> int: ...

    def __getitem__(self: P, part: slice) -> P: ...


@dataclass(frozen=True)
class PosePath:
    """Poses in the order in which they are passed, at equal shares of the duration; a :class:`MotionPath`.

    Attributes:
        position_m: In the robot's frame [m].
        orientation: Unit quaternions wxyz, or unit vectors in space [-].

    Raises:
        ShapeMismatch: If they differ in number, or orientations have neither three nor four coordinates.
        InvalidSetting: If there is no pose, or orientations are not of length one.
    """

    position_m: Positions
    orientation: Float[np.ndarray, "other_pose Dq"]

    def __post_init__(self) -> None:
        if len(self.position_m) != len(self.orientation):
            raise ShapeMismatch("orientations of a path", len(self.position_m), len(self.orientation))
        if self.orientation.shape[1] not in (DIRECTION, QUATERNION):
            raise ShapeMismatch("coordinates of an orientation", "3 or 4", self.orientation.shape[1])
        if len(self) == 0:
            raise InvalidSetting("path", "no pose", "one pose or more")
        deviation = np.abs(np.linalg.norm(self.orientation, axis=1) - 1).max()
        if not deviation < UNIT_TOLERANCE:
            raise InvalidSetting("path.orientation", f"lengths up to {deviation:.2g} from one", "unit vectors")

    def __len__(self) -> int:
        return len(self.position_m)

    def __getitem__(self, part: slice) -> "PosePath":
        """Part of the path; ``path[:1]`` is its first pose."""
        return PosePath(self.position_m[part], self.orientation[part])

    @property
    def vectors(self) -> Float[np.ndarray, "pose D"]:
        """Positions and orientations side by side.

        An offset of zero changes nothing, and quaternions and directions need no separate rules.
        """
        return np.concatenate([self.position_m, self.orientation], axis=1)

    def with_vectors(self, values: Float[np.ndarray, "other_pose D"]) -> "PosePath":
        """Poses from positions and orientations side by side; the latter are brought to length one."""
        dim = self.position_m.shape[1]
        return PosePath(values[:, :dim], _unit(values[:, dim:]))

    def with_signs_of(self, known: "PosePath") -> "PosePath":
        """±q are one orientation: take the signs that known poses have."""
        if self.orientation.shape[1] != QUATERNION:
            return self
        signs = np.where((known.orientation * self.orientation).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
        return PosePath(self.position_m, signs * self.orientation)

    def residuals(self, other: "PosePath") -> tuple[Float[np.ndarray, " pose"], Float[np.ndarray, " pose"]]:
        """Distances of positions [m] and angles between orientations [rad], pose by pose."""
        apart_m = np.linalg.norm(self.position_m - other.position_m, axis=1)
        chords = np.linalg.norm(self.with_signs_of(other).orientation - other.orientation, axis=1)
        return apart_m, _angles(chords, self.orientation.shape[1])

    def steps_m(self) -> Float[np.ndarray, " step"]:
        """Lengths of the steps between poses with quaternions [m], a radian counting as `LEVER_M`."""
        turned_rad = 2 * np.linalg.norm(np.diff(self.orientation, axis=0), axis=1)
        return np.asarray(np.hypot(np.linalg.norm(np.diff(self.position_m, axis=0), axis=1), LEVER_M * turned_rad))

    def resampled(self, count: int) -> "PosePath":
        """Interpolated at equal shares of the duration; quaternions are of one sign along the path."""
        shares, wanted = np.linspace(0, 1, len(self)), np.linspace(0, 1, count)
        orientation = _at_shares(wanted, shares, of_one_sign(self.orientation))
        return PosePath(_at_shares(wanted, shares, self.position_m), _unit(orientation))


@dataclass(frozen=True)
class PoseDistance:
    """A distance between two paths, or a ratio of two of them.

    Attributes:
        position: [m], or none for a ratio.
        orientation: [rad], or none for a ratio.
    """

    position: float
    orientation: float


def orientation_angles(
    orientation: Orientations, other: Float[np.ndarray, "other_pose Dq"]
) -> Float[np.ndarray, "pose other_pose"]:
    """Angles between all pairs [rad]: of the rotation between quaternions, 2 acos|<q, q'>|, or between unit vectors.

    From the chords, which are exact for small angles, where an arc cosine is not.
    """
    chords = cdist(orientation, other)
    if orientation.shape[1] == QUATERNION:
        chords = np.minimum(chords, cdist(orientation, -other))
    return _angles(chords, orientation.shape[1])


def _angles(chords: Float[np.ndarray, "*batch"], dim: int) -> Float[np.ndarray, "*batch"]:
    """Angles [rad] from distances between orientations of one sign."""
    angles = 2 * np.arcsin(np.minimum(chords / 2, 1))
    return np.asarray(2 * angles if dim == QUATERNION else angles)


def pose_dtwd(path: MotionPath, other: MotionPath) -> PoseDistance:
    """DTWD per point, as in :func:`geomotion.scores.curves.dtwd_per_point`, of positions and of orientations apart.

    Source:
        Thesis Sec. 6.4, definition of DTWD.
    """
    angles = orientation_angles(path.orientation, other.orientation)
    turn = angles.min(axis=1).mean() + angles.min(axis=0).mean()
    return PoseDistance(dtwd_per_point(path.position_m, other.position_m), float(turn))


def dtwd_ratio(path: PosePath, demonstration: PosePath, others: Sequence[PosePath]) -> PoseDistance:
    """DTWD between a path and the demonstration with its ends, over the mean of that demonstration to the others.

    Below one, the path is nearer to this demonstration than the others are.
    """
    own = pose_dtwd(path, demonstration)
    between = [pose_dtwd(demonstration, other) for other in others]
    return PoseDistance(
        own.position / float(np.mean([distance.position for distance in between])),
        own.orientation / float(np.mean([distance.orientation for distance in between])),
    )


def mean_path(demonstrations: Sequence[PosePath], count: int = 200) -> PosePath:
    """Mean pose of demonstrations at equal shares of their durations."""
    aligned = [demo.resampled(count) for demo in demonstrations]
    return PosePath(
        np.mean([demo.position_m for demo in aligned], axis=0),
        _mean_orientation([demo.orientation for demo in aligned]),
    )


def mean_path_with_blended_ends(
    demonstrations: Sequence[PosePath], start: PosePath, goal: PosePath, count: int = 200
) -> PosePath:
    """The baseline: mean pose of the demonstrations at equal shares of their durations, led to other ends.

    What is missing at the start fades out linearly over the path, and what is missing at the goal fades in: positions
    by addition, rotations by the exponential of the blended rotation vector in the frame of the mean pose, unit
    vectors by addition and normalisation.

    Args:
        demonstrations: One or more.
        start: Its first pose is where the path begins.
        goal: Its last pose is where the path ends.
        count: Poses of the path.
    """
    mean = mean_path(demonstrations, count)
    position, orientation = mean.position_m, mean.orientation
    share = np.linspace(0, 1, count)[:, None]
    at_start, at_goal = start.position_m[0] - position[0], goal.position_m[-1] - position[-1]
    blend = _turned if orientation.shape[1] == QUATERNION else _bent
    return PosePath(
        position + (1 - share) * at_start + share * at_goal,
        blend(orientation, start.orientation[0], goal.orientation[-1], share),
    )


def of_one_sign(orientation: Orientations) -> Orientations:
    """Quaternions with signs such that neighbours are near each other, the first as it is; unit vectors as they are."""
    if orientation.shape[1] != QUATERNION:
        return orientation
    turns = (orientation[1:] * orientation[:-1]).sum(axis=1) < 0
    return orientation * np.where(np.concatenate([[0], turns.cumsum()]) % 2, -1.0, 1.0)[:, None]


def _mean_orientation(orientations: Sequence[Orientations]) -> Orientations:
    first = orientations[0]
    if first.shape[1] == QUATERNION:
        orientations = [np.where((q * first).sum(axis=1, keepdims=True) < 0, -q, q) for q in orientations]
    return _unit(np.mean(orientations, axis=0))


def _turned(
    orientation: Float[np.ndarray, "pose 4"],
    start: Float[np.ndarray, " 4"],
    goal: Float[np.ndarray, " 4"],
    share: Float[np.ndarray, "pose 1"],
) -> Float[np.ndarray, "pose 4"]:
    mean, ends = (Rotation.from_quat(q, scalar_first=True) for q in (orientation, np.stack([start, goal])))
    at_start, at_goal = (mean[[0, -1]].inv() * ends).as_rotvec()
    turned = mean * Rotation.from_rotvec((1 - share) * at_start + share * at_goal)
    return of_one_sign(turned.as_quat(scalar_first=True))


def _bent(
    orientation: Orientations,
    start: Float[np.ndarray, " Dq"],
    goal: Float[np.ndarray, " Dq"],
    share: Float[np.ndarray, "pose 1"],
) -> Orientations:
    return _unit(orientation + (1 - share) * (start - orientation[0]) + share * (goal - orientation[-1]))


def _at_shares(
    wanted: Float[np.ndarray, " count"], shares: Float[np.ndarray, " pose"], values: Float[np.ndarray, "pose D"]
) -> Float[np.ndarray, "count D"]:
    return np.stack([np.interp(wanted, shares, coordinate) for coordinate in values.T], axis=1)


def _unit(vectors: Orientations) -> Orientations:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def path_length_m(position_m: Positions) -> float:
    """Length of the polyline through the points [m]."""
    return float(np.linalg.norm(np.diff(position_m, axis=0), axis=1).sum())


def turning_rad(position_m: Positions, spacing_m: float = 0.01) -> float:
    """Sum of the angles between successive pieces of a path, cut into pieces of equal length, about the spacing [rad].

    Cutting makes paths comparable that have different numbers of points; shorter wiggles do not count.

    Raises:
        InvalidSetting: If the spacing is not positive.
    """
    if not spacing_m > 0:
        raise InvalidSetting("spacing_m", spacing_m, "a length above 0")
    travelled = np.concatenate([[0], np.linalg.norm(np.diff(position_m, axis=0), axis=1).cumsum()])
    pieces = max(round(travelled[-1] / spacing_m), 1)
    steps = np.diff(_at_shares(np.linspace(0, travelled[-1], pieces + 1), travelled, position_m), axis=0)
    lengths = np.linalg.norm(steps, axis=1, keepdims=True)
    directions = steps / np.where(lengths > 0, lengths, 1)
    chords = np.linalg.norm(np.diff(directions, axis=0), axis=1)
    return float(2 * np.arcsin(np.minimum(chords / 2, 1)).sum())


def dimensionless_jerk(position_m: Positions) -> float:
    r"""Jerk of points passed at equal shares of the duration; it depends on the shape of the motion alone.

    .. math:: \frac{T^5}{L^2} \int_0^T \|\dddot{x}\|^2 dt

    with the duration T and the length L; 720 for a straight motion of minimum jerk, more for any other. It is nearly
    proportional to the square of high-frequency noise, so compare its logarithm.

    Raises:
        ShapeMismatch: If there are fewer than four points.
        InvalidSetting: If they are all in one place.

    Source:
        Hogan, Sternad (2009), Sensitivity of smoothness measures to movement duration, amplitude, and arrests.
    """
    if len(position_m) < 4:
        raise ShapeMismatch("points of a path, for its jerk", "4 or more", len(position_m))
    length = path_length_m(position_m)
    if length == 0:
        raise InvalidSetting("path", "a single place", "a path that moves")
    jerk = np.diff(position_m, n=3, axis=0) * (len(position_m) - 1) ** 3
    return float((jerk**2).sum(axis=1).mean() / length**2)
