"""Any serial arm of turning joints, as its URDF describes it: kinematics, limits, and points of its body."""

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from geomotion.errors import InvalidSetting
from geomotion.robot.body import BodyPoints
from geomotion.robot.chain import Chain, chain_of
from geomotion.robot.collision import CUBE, LinkShape, link_shapes, resting_positions, root_in_link
from geomotion.robot.cover import cover_hull
from geomotion.robot.description import TURNING, read_urdf
from geomotion.robot.panda import JointLimits
from geomotion.types import Float

ACCELERATION_RAD_PER_S2, JERK_RAD_PER_S3 = 5.0, 500.0  # of joints, where nothing says more: URDFs do not
EXCESS_M = 0.03
SIMULATOR_MARGIN_M = 0.001  # PyBullet swells the shapes of a URDF by that much
BARE_RADIUS_M = 0.05  # of the balls that stand for links without collision shapes


@dataclass(frozen=True, eq=False)
class Arm:
    """A serial arm from its base to its tip.

    Attributes:
        name: As the URDF has it.
        urdf: Where it was read.
        base_link: Where the arm is fixed; coordinates are those of its frame.
        tip_link: The end effector.
        root: The frame of the URDF's root link in that of the base link, shape (4, 4) [m].
        resting: Where each joint that is not the arm's is taken to be [m or rad].
        chain: Kinematics.
        joint_names: In the order of the chain.
        limits: One number per joint; positions are from −∞ to ∞ where a joint turns endlessly.
        shapes: Collision shapes of everything that moves with the joints.
    """

    name: str
    urdf: Path
    base_link: str
    tip_link: str
    root: Float[np.ndarray, "4 4"]
    resting: dict[str, float]
    chain: Chain
    joint_names: tuple[str, ...]
    limits: JointLimits
    shapes: tuple[LinkShape, ...]

    def joint_points(self, between: int = 0) -> BodyPoints:
        """Origins of all joints and the tip, B = η + 1 points without radius, Thesis Sec. 4.1.

        Args:
            between: Points evenly between each of these and the next one, where they are apart.

        Raises:
            InvalidSetting: If `between` is negative.
        """
        if between < 0:
            raise InvalidSetting("between", between, "0 or more")
        frames, offsets = [], []
        for frame, segment in enumerate(self._segments):
            count = between + 1 if segment.any() else 1
            frames += [frame] * count
            offsets += [segment * share for share in np.arange(count) / count]
        frames, offsets = [*frames, frame], [*offsets, segment]  # the tip
        return BodyPoints(np.array(frames), np.stack(offsets), np.zeros(len(frames)))

    def cover(self, excess_m: float = EXCESS_M) -> BodyPoints:
        """Balls that together contain every link that moves, as PyBullet sees it.

        Links fixed to the arm or beyond its tip belong to it; fingers are open. For a frame without collision shapes,
        balls of 5 cm radius stand along the line to the next joint.

        Args:
            excess_m: How far balls reach beyond the links' convex hulls, about [m]; fewer balls do where it is larger.

        Raises:
            InvalidSetting: If `excess_m` is not positive, or a mesh cannot be read.
            MissingData: If a mesh is not there.
        """
        if not excess_m > 0:
            raise InvalidSetting("excess_m", excess_m, "a length above 0")
        return _cover(self, excess_m)

    @property
    def _segments(self) -> Float[np.ndarray, "joint 3"]:
        """From each joint to the next one, or the tip, in the joint's frame [m]."""
        return np.concatenate([self.chain.before[1:, :3, 3], self.chain.tip[None, :3, 3]])


def read_arm(
    path: Path,
    base_link: str,
    tip_link: str,
    acceleration_rad_per_s2: float = ACCELERATION_RAD_PER_S2,
    jerk_rad_per_s3: float = JERK_RAD_PER_S3,
) -> Arm:
    """The arm between two links of a URDF; soft limits of position count where there are any.

    Args:
        path: The URDF.
        base_link: Where the arm is fixed; coordinates are those of its frame.
        tip_link: The end effector.
        acceleration_rad_per_s2: Largest acceleration of every joint [rad/s²].
        jerk_rad_per_s3: Largest jerk of every joint [rad/s³].

    Raises:
        MissingData: If there is no such file.
        InvalidSetting: If it is no URDF, or what is between the links is no serial chain of joints that turn.
        UnknownName: If there is no such link.
    """
    urdf = read_urdf(path)
    joints = urdf.joints_between(base_link, tip_link)
    chain = chain_of(joints)
    turning = [joint for joint in joints if joint.type in TURNING]
    lower, upper, velocity = np.array([_limits(joint) for joint in turning]).T
    every = np.ones(len(turning))
    limits = JointLimits(lower, upper, velocity, acceleration_rad_per_s2 * every, jerk_rad_per_s3 * every)
    names = tuple(joint.name for joint in turning)
    resting = {name: position for name, position in resting_positions(urdf).items() if name not in names}
    root = root_in_link(urdf, base_link, resting)
    return Arm(urdf.name, path, base_link, tip_link, root, resting, chain, names, limits, link_shapes(urdf, joints))


def _limits(joint: Any) -> tuple[float, float, float]:
    """Smallest and largest position [rad], largest speed [rad/s]."""
    if joint.limit is None:
        if joint.type == "revolute":
            raise InvalidSetting("arm.urdf", f"joint {joint.name!r} without limits", "a revolute joint to have some")
        return -np.inf, np.inf, np.inf
    velocity = float(joint.limit.velocity)
    lower, upper = float(joint.limit.lower or 0.0), float(joint.limit.upper or 0.0)
    if joint.type == "continuous":
        lower, upper = -np.inf, np.inf
    elif joint.safety_controller is not None:
        lower = max(lower, float(joint.safety_controller.soft_lower_limit))
        upper = min(upper, float(joint.safety_controller.soft_upper_limit))
    if not (lower < upper and velocity > 0):
        found = f"joint {joint.name!r} from {lower:g} to {upper:g} rad at {velocity:g} rad/s"
        raise InvalidSetting("arm.urdf", found, "a range and a speed above 0")
    return lower, upper, velocity


@functools.cache
def _cover(arm: Arm, excess_m: float) -> BodyPoints:
    frames, centres, radii = [], [], []
    for shape in arm.shapes:
        swollen = (shape.corners_m()[:, None] + SIMULATOR_MARGIN_M * CUBE).reshape(-1, 3)
        found_m, radius_m = cover_hull(swollen, excess_m)
        frames.append(np.full(len(found_m), shape.frame))
        centres.append(found_m)
        radii.append(radius_m)
    for frame in set(range(len(arm.joint_names))) - {shape.frame for shape in arm.shapes}:
        segment = arm._segments[frame]
        count = int(np.ceil(np.linalg.norm(segment) / BARE_RADIUS_M))
        frames.append(np.full(count + 1, frame))
        centres.append(np.linspace(0, 1, count + 1)[:, None] * segment)
        radii.append(np.full(count + 1, BARE_RADIUS_M))
    return BodyPoints(np.concatenate(frames), np.concatenate(centres), np.concatenate(radii))
