"""Inverse kinematics of the Panda for a path of poses with a wanted swivel of the elbow.

A pose leaves the arm one motion of its own, which turns the elbow. Each pose is met first; the elbow is turned within
what that leaves, so that a wanted swivel that the joint limits forbid costs no accuracy of the pose.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from geomotion.errors import ShapeMismatch
from geomotion.robot import panda
from geomotion.robot.chain import Chain, panda_chain
from geomotion.robot.inverse_kinematics import JointPath, judge, pose_transforms, solve_path
from geomotion.robot.pose_search import CONVERGED_M, DAMPING_M2, LEVER_M, STALLED, pose_error
from geomotion.robot.swivel import swivel_and_gradient, swivel_rad
from geomotion.types import Bool, Float

# Hand down, elbow up. At home the upper arm leans back; to lean it forwards turns the shoulder round wherever the elbow
# is not straight up.
REST_RAD = np.array([0.0, np.pi / 6, 0.0, -2 * np.pi / 3, 0.0, 5 * np.pi / 6, np.pi / 4])
LEAD_IN_POSES = 20
ITERATIONS = 100
AT_REST_RAD = 1e-9  # a step smaller than this changes nothing any more
LARGEST_TURN_RAD = 0.2  # of the elbow in one step
SWIVEL_DAMPING = 1e-4
ATTAINED_RAD = 1e-3
TINY_RAD = 1e-15


@dataclass(frozen=True)
class SwivelPath:
    """Joint positions for the poses of a path, and what the elbow does meanwhile.

    Attributes:
        path: Joint positions and what is left to each pose.
        swivel_rad: Swivel angle taken [rad].
        swivel_error_rad: By how much it misses the one wanted [rad]; above 1e-3 rad, joint limits forbid that one.
    """

    path: JointPath
    swivel_rad: Float[np.ndarray, " pose"]
    swivel_error_rad: Float[np.ndarray, " pose"]

    @property
    def attained(self) -> Bool[np.ndarray, " pose"]:
        """Whether the elbow is where it was wanted."""
        attained: Bool[np.ndarray, " pose"] = self.swivel_error_rad <= ATTAINED_RAD
        return attained


def solve_swivel_path(
    positions_m: Float[np.ndarray, "pose 3"],
    orientations_wxyz: Float[np.ndarray, "pose 4"],
    wanted_rad: Float[np.ndarray, " angle"],
    frame: panda.Frame = "grasp_target",
) -> SwivelPath:
    """Follow a path of poses without jumps, the elbow at wanted swivel angles (:func:`swivel.swivel_rad`).

    The arm comes from one rest configuration, so that all paths in front of it are followed on one branch; where that
    one does not reach every pose and swivel, the branch that :func:`solve_path` finds for the first is tried as well.

    Args:
        positions_m: In the base frame [m].
        orientations_wxyz: Unit quaternions; the sign does not matter.
        wanted_rad: Wanted swivel angles [rad].
        frame: Which frame of the arm takes the poses.

    Raises:
        ShapeMismatch: If there are no poses, or not one orientation and one swivel angle per position.
        InvalidSetting: If a number is not finite or a quaternion is not of unit length.
    """
    targets, chain = pose_transforms(positions_m, orientations_wxyz), panda_chain(frame)
    if wanted_rad.shape != (len(targets),):
        raise ShapeMismatch("swivel angles", f"({len(targets)},), one for each pose", wanted_rad.shape)
    best = _follow(chain, targets, wanted_rad, _led_in(chain, targets[0], float(wanted_rad[0])))
    if not (best.path.reached.all() and best.attained.all()):
        start_rad = solve_path(positions_m[:1], orientations_wxyz[:1], frame).joints_rad[0]
        best = max(best, _follow(chain, targets, wanted_rad, start_rad), key=_merit)
    return best


def _led_in(chain: Chain, target: Float[np.ndarray, "4 4"], wanted_rad: float) -> Float[np.ndarray, " joint"]:
    """Joint positions for the first pose, led there from rest along a line and the shortest turn."""
    q = REST_RAD
    rest, _ = chain.pose_and_jacobian(q)
    turn = Rotation.from_matrix(target[:3, :3] @ rest[:3, :3].T).as_rotvec()
    between = rest.copy()
    for share in np.linspace(0, 1, LEAD_IN_POSES, endpoint=False)[1:]:
        between[:3, :3] = Rotation.from_rotvec(share * turn).as_matrix() @ rest[:3, :3]
        between[:3, 3] = rest[:3, 3] + share * (target[:3, 3] - rest[:3, 3])
        q = _search(chain, between, share * wanted_rad, q)
    return q


def _follow(
    chain: Chain,
    targets: Float[np.ndarray, "pose 4 4"],
    wanted_rad: Float[np.ndarray, " pose"],
    start_rad: Float[np.ndarray, " joint"],
) -> SwivelPath:
    joints: list[Float[np.ndarray, " joint"]] = []
    for target, wanted in zip(targets, wanted_rad, strict=True):
        joints.append(_search(chain, target, float(wanted), joints[-1] if joints else start_rad))
    path = judge(chain, targets, np.stack(joints))
    taken = swivel_rad(path.joints_rad)
    return SwivelPath(path, taken, np.abs(_wrapped(taken - wanted_rad)))


def _merit(found: SwivelPath) -> tuple[int, int, float]:
    return int(found.path.reached.sum()), int(found.attained.sum()), float(found.path.limit_margin_rad.min())


def _search(
    chain: Chain, target: Float[np.ndarray, "4 4"], wanted_rad: float, start_rad: Float[np.ndarray, " joint"]
) -> Float[np.ndarray, " joint"]:
    """Joint positions within the limits that take the pose, or come nearest, with the elbow where it is wanted."""
    q: Float[np.ndarray, " joint"] = np.clip(start_rad, panda.LIMITS.lower_rad, panda.LIMITS.upper_rad)
    before = np.inf
    for _ in range(ITERATIONS):
        frames = chain.frames(q)
        error = pose_error(frames[-1], target)
        swivel, gradient = swivel_and_gradient(chain, frames)
        J = chain.jacobian(frames, frames[-1, :3, 3])
        J[3:] *= LEVER_M
        moved = _step(q, J, error, gradient, float(_wrapped(wanted_rad - swivel)))
        step, q = np.abs(moved - q).max(), moved
        square = float(error @ error)
        if step < AT_REST_RAD if square < CONVERGED_M**2 else abs(before - square) < STALLED * square:
            break
        before = square
    return q


def _step(
    q: Float[np.ndarray, " joint"],
    J: Float[np.ndarray, "6 joint"],
    error: Float[np.ndarray, "6"],
    gradient: Float[np.ndarray, " joint"],
    turn_rad: float,
) -> Float[np.ndarray, " joint"]:
    """One damped step to the pose, and along the motion that leaves the pose alone towards the swivel.

    Joints that the first would carry beyond a limit stay there, and the others make up for them; the second goes as far
    as the first limit.
    """
    lower, upper = panda.LIMITS.lower_rad, panda.LIMITS.upper_rad
    is_free = np.ones(len(q), dtype=bool)
    for _ in range(len(q)):
        K = J * is_free
        step = K.T @ np.linalg.solve(K @ K.T + (error @ error / 2 + DAMPING_M2) * np.eye(6), error)
        beyond = is_free & ((q + step < lower) | (q + step > upper))
        if not beyond.any():
            break
        is_free &= ~beyond
    moved = np.clip(q + step, lower, upper)
    free = np.linalg.svd(J)[2][-1]
    rate = gradient @ free
    wanted = np.clip(turn_rad - gradient @ step, -LARGEST_TURN_RAD, LARGEST_TURN_RAD)
    turn = free * wanted * rate / (rate**2 + SWIVEL_DAMPING)
    room = np.where(turn > 0, upper - moved, moved - lower)
    share = min(1.0, float((room / np.maximum(np.abs(turn), TINY_RAD)).min()))
    kept: Float[np.ndarray, " joint"] = np.clip(moved + share * turn, lower, upper)
    return kept


def _wrapped(angle_rad: Float[np.ndarray, "*batch"] | float) -> Float[np.ndarray, "*batch"]:
    """The same angle between -π and π."""
    wrapped: Float[np.ndarray, "*batch"] = np.asarray((np.asarray(angle_rad) + np.pi) % (2 * np.pi) - np.pi)
    return wrapped
