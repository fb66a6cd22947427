"""Joint positions for a path of end-effector poses.

Each pose is searched from the one before, so that the arm stays on one branch; the first pose decides which.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.robot import panda
from geomotion.robot.chain import Chain, panda_chain
from geomotion.robot.pose_search import search
from geomotion.types import Bool, Float

POSITION_TOLERANCE_M = 1e-3
ORIENTATION_TOLERANCE_RAD = np.radians(0.5)
ENOUGH_MARGIN_RAD = 0.1  # a branch that keeps this far from all limits is taken without trying others
RANDOM_STARTS, SEED = 12, 0
SAME_BRANCH_RAD = 0.3


@dataclass(frozen=True)
class UnreachablePose:
    """A pose that the arm cannot take, and how near it comes.

    Attributes:
        index: Row of the path.
        position_error_m: Distance that remains [m].
        orientation_error_rad: Angle that remains [rad].
    """

    index: int
    position_error_m: float
    orientation_error_rad: float


@dataclass(frozen=True)
class JointPath:
    """Joint positions for the poses of a path, and what is left to each pose.

    Attributes:
        joints_rad: Within the joint limits [rad].
        position_error_m: Distance between the pose reached and the one wanted [m].
        orientation_error_rad: Angle between them [rad].
        limit_margin_rad: Distance of the joint closest to a limit [rad].
        reached: Whether both errors are within 1 mm and 0.5°.
    """

    joints_rad: Float[np.ndarray, "pose joint"]
    position_error_m: Float[np.ndarray, " pose"]
    orientation_error_rad: Float[np.ndarray, " pose"]
    limit_margin_rad: Float[np.ndarray, " pose"]
    reached: Bool[np.ndarray, " pose"]

    @property
    def unreachable(self) -> tuple[UnreachablePose, ...]:
        """The poses that were not reached, in order."""
        return tuple(
            UnreachablePose(int(i), float(self.position_error_m[i]), float(self.orientation_error_rad[i]))
            for i in np.flatnonzero(~self.reached)
        )

    @property
    def largest_step_rad(self) -> float:
        """Largest change of a joint between neighbouring poses [rad]; a jump shows here."""
        return float(np.abs(np.diff(self.joints_rad, axis=0)).max(initial=0.0))


def exactly(joints_rad: Float[np.ndarray, "pose joint"], limits: panda.JointLimits) -> JointPath:
    """Joint positions that are asked for themselves, so that nothing is left."""
    nothing = np.zeros(len(joints_rad))
    return JointPath(joints_rad, nothing, nothing, limits.margin_rad(joints_rad), np.ones(len(joints_rad), bool))


def solve_path(
    positions_m: Float[np.ndarray, "pose 3"],
    orientations_wxyz: Float[np.ndarray, "pose 4"],
    frame: panda.Frame = "grasp_target",
) -> JointPath:
    """Follow a path of poses with the Panda's joints, without jumps.

    Of the arm's branches (elbow left or right, wrist turned), the one from the home configuration is followed;
    unless it reaches every pose far from the joint limits, branches from seeded random configurations are, too, and
    the one with the most poses reached, then with the largest margin, is returned.

    Args:
        positions_m: In the base frame [m].
        orientations_wxyz: Unit quaternions; the sign does not matter.
        frame: Which frame of the arm takes the poses.

    Raises:
        ShapeMismatch: If there are no poses, or not one orientation per position.
        InvalidSetting: If a number is not finite or a quaternion is not of unit length.
    """
    targets = pose_transforms(positions_m, orientations_wxyz)
    chain = panda_chain(frame)
    best = _follow(chain, targets, search(chain, targets[0], panda.HOME_RAD))
    if not _is_good(best):
        for first in _other_branches(chain, targets[0], best.joints_rad[0]):
            best = max(best, _follow(chain, targets, first), key=_merit)
            if _is_good(best):
                break
    return best


def solve_path_from(
    start_rad: Float[np.ndarray, " joint"],
    positions_m: Float[np.ndarray, "pose 3"],
    orientations_wxyz: Float[np.ndarray, "pose 4"],
    frame: panda.Frame = "grasp_target",
) -> JointPath:
    """A path of poses as :func:`solve_path` has it, on the branch of joint positions that are given [rad].

    Raises:
        ShapeMismatch: If there are no poses, or not one orientation per position.
        InvalidSetting: If a number is not finite or a quaternion is not of unit length.
    """
    targets, chain = pose_transforms(positions_m, orientations_wxyz), panda_chain(frame)
    return _follow(chain, targets, search(chain, targets[0], start_rad))


def solve_pose(
    position_m: Float[np.ndarray, "3"],
    orientation_wxyz: Float[np.ndarray, "4"],
    start_rad: Float[np.ndarray, " joint"],
    frame: panda.Frame = "grasp_target",
) -> JointPath:
    """One pose, searched from joint positions nearby, as a control loop does; a path of one row.

    Args:
        position_m: In the base frame [m].
        orientation_wxyz: A unit quaternion.
        start_rad: [rad].
        frame: Which frame of the arm takes the pose.

    Raises:
        InvalidSetting: If a number is not finite or the quaternion is not of unit length.
    """
    return solve_path_from(start_rad, position_m[None], orientation_wxyz[None], frame)


def _follow(chain: Chain, targets: Float[np.ndarray, "pose 4 4"], first: Float[np.ndarray, " joint"]) -> JointPath:
    joints = [first]
    for target in targets[1:]:
        joints.append(search(chain, target, joints[-1]))
    return judge(chain, targets, np.stack(joints))


def judge(
    chain: Chain, targets: Float[np.ndarray, "pose 4 4"], joints_rad: Float[np.ndarray, "pose joint"]
) -> JointPath:
    """Joint positions for poses, with what is left to each of them."""
    positions, quaternions = chain.pose(joints_rad)
    position_error = np.linalg.norm(targets[:, :3, 3] - positions, axis=1)
    turns = Rotation.from_matrix(targets[:, :3, :3]) * Rotation.from_quat(quaternions, scalar_first=True).inv()
    reached = (position_error <= POSITION_TOLERANCE_M) & (turns.magnitude() <= ORIENTATION_TOLERANCE_RAD)
    return JointPath(joints_rad, position_error, turns.magnitude(), panda.LIMITS.margin_rad(joints_rad), reached)


def _is_good(path: JointPath) -> bool:
    return bool(path.reached.all() and path.limit_margin_rad.min() > ENOUGH_MARGIN_RAD)


def _merit(path: JointPath) -> tuple[int, float]:
    return int(path.reached.sum()), float(path.limit_margin_rad.min())


def _other_branches(
    chain: Chain, target: Float[np.ndarray, "4 4"], known: Float[np.ndarray, " joint"]
) -> Iterator[Float[np.ndarray, " joint"]]:
    """Solutions for one pose that differ from the known one and from each other."""
    lower, upper = panda.LIMITS.lower_rad, panda.LIMITS.upper_rad
    found = [known]
    for start in np.random.default_rng(SEED).uniform(lower, upper, size=(RANDOM_STARTS, len(lower))):
        q = search(chain, target, start)
        if judge(chain, target[None], q[None]).reached[0] and all(
            np.abs(q - other).max() > SAME_BRANCH_RAD for other in found
        ):
            found.append(q)
            yield q


def pose_transforms(
    positions_m: Float[np.ndarray, "pose 3"], orientations_wxyz: Float[np.ndarray, "pose 4"]
) -> Float[np.ndarray, "pose 4 4"]:
    """Poses as homogeneous transforms [m].

    Raises:
        ShapeMismatch: If there are no poses, or not one orientation per position.
        InvalidSetting: If a number is not finite or a quaternion is not of unit length.
    """
    _check(positions_m, orientations_wxyz)
    transforms = np.tile(np.eye(4), (len(positions_m), 1, 1))
    transforms[:, :3, :3] = Rotation.from_quat(orientations_wxyz, scalar_first=True).as_matrix()
    transforms[:, :3, 3] = positions_m
    return transforms


def _check(positions_m: Float[np.ndarray, "pose 3"], orientations_wxyz: Float[np.ndarray, "pose 4"]) -> None:
    if len(positions_m) == 0 or len(positions_m) != len(orientations_wxyz):
        raise ShapeMismatch(
            "a path of poses",
            "as many orientations as positions, at least one",
            (len(positions_m), len(orientations_wxyz)),
        )
    for name, values in (("positions_m", positions_m), ("orientations_wxyz", orientations_wxyz)):
        if not np.isfinite(values).all():
            raise InvalidSetting(name, f"NaN in pose {int(np.argmin(np.isfinite(values).all(axis=1)))}", "numbers")
    lengths = np.linalg.norm(orientations_wxyz, axis=1)
    if np.abs(lengths - 1).max() > 1e-3:
        worst = int(np.abs(lengths - 1).argmax())
        raise InvalidSetting("orientations_wxyz", f"|q|={lengths[worst]:.3g} in pose {worst}", "unit quaternions")
