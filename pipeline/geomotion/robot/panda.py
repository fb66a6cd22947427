"""The Franka Emika Panda: its joints, limits, links and frames.

Sources: the position, velocity, acceleration and jerk limits are those of the Franka Control Interface documentation,
"Robot and interface specifications" for the Panda; the URDF in ``pybullet_data`` repeats the first as soft limits and
allows four degrees more as hard ones, which the real arm does not.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from geomotion.errors import InvalidSetting
from geomotion.robot.gripper import Gripper
from geomotion.types import Float

Frame = Literal["grasp_target", "flange"]
FRAME_LINKS: dict[Frame, str] = {"grasp_target": "panda_grasptarget", "flange": "panda_link8"}
JOINTS = tuple(f"panda_joint{number}" for number in range(1, 8))
BASE_LINK = "panda_link0"
GRIPPER = Gripper("panda_grasptarget", ("panda_finger_joint1", "panda_finger_joint2"))
HOME_RAD = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])

# of the collision shapes of hand and fingers, in the grasp-target frame: y [m], z [m], radius [m]; x is zero
HAND_BALLS = (
    *((y, -0.085, 0.062) for y in (-0.08, -0.04, 0.0, 0.04, 0.08)),
    *((y, -0.02, 0.045) for y in (-0.04, 0.04)),
)
GRASP_TARGET_M = 0.105  # from the flange, along its z axis
HAND_TURN_RAD = -np.pi / 4  # of the hand, about the flange's z axis


@dataclass(frozen=True)
class JointLimits:
    """What each joint may do; one number per joint.

    Attributes:
        lower_rad: Smallest position [rad].
        upper_rad: Largest position [rad].
        velocity_rad_per_s: Largest speed [rad/s].
        acceleration_rad_per_s2: Largest acceleration [rad/s²].
        jerk_rad_per_s3: Largest jerk [rad/s³].
    """

    lower_rad: Float[np.ndarray, " joint"]
    upper_rad: Float[np.ndarray, " joint"]
    velocity_rad_per_s: Float[np.ndarray, " joint"]
    acceleration_rad_per_s2: Float[np.ndarray, " joint"]
    jerk_rad_per_s3: Float[np.ndarray, " joint"]

    def scaled(self, share: float) -> "JointLimits":
        """Limits for a more careful motion: velocity, acceleration and jerk times `share`.

        Raises:
            InvalidSetting: If `share` is not above 0 and at most 1.
        """
        if not 0 < share <= 1:
            raise InvalidSetting("robot.limit_share", share, "a number above 0 and at most 1")
        return JointLimits(
            self.lower_rad,
            self.upper_rad,
            share * self.velocity_rad_per_s,
            share * self.acceleration_rad_per_s2,
            share * self.jerk_rad_per_s3,
        )

    def stopping_speed(self, room_rad: Float[np.ndarray, " joint"], period_s: float) -> Float[np.ndarray, " joint"]:
        """Speeds of one period, from which a joint can stop within a room that begins with that period [rad/s]."""
        change = self.acceleration_rad_per_s2 * period_s  # the largest in one period
        # from v, periods at v, v - change, v - 2 change, … cover at most v²/2a + v period/2 + a period²/8
        room = np.maximum(room_rad - change * period_s / 8, 0)
        speed: Float[np.ndarray, " joint"] = (
            np.sqrt(change**2 / 4 + 2 * self.acceleration_rad_per_s2 * room) - change / 2
        )
        return speed

    def margin_rad(self, joints_rad: Float[np.ndarray, "*batch joint"]) -> Float[np.ndarray, "*batch"]:
        """Distance of the joint closest to one of its position limits [rad], negative beyond it."""
        smallest: Float[np.ndarray, "*batch"] = np.minimum(
            joints_rad - self.lower_rad, self.upper_rad - joints_rad
        ).min(axis=-1)
        return smallest


LIMITS = JointLimits(
    lower_rad=np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]),
    upper_rad=np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]),
    velocity_rad_per_s=np.array([2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61]),
    acceleration_rad_per_s2=np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]),
    jerk_rad_per_s3=np.array([7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0]),
)


def urdf_path() -> Path:
    """The arm's description with its meshes, as shipped by ``pybullet_data``."""
    import pybullet_data

    return Path(pybullet_data.getDataPath()) / "franka_panda/panda.urdf"


def frame_of(tip_link: str) -> Frame:
    """The frame that an arm's tip is.

    Raises:
        InvalidSetting: If that is none of the Panda's, whose inverse kinematics are all there are.
    """
    for frame, link in FRAME_LINKS.items():
        if link == tip_link:
            return frame
    expected = f"{' or '.join(FRAME_LINKS.values())}, of the Panda: other arms take configurations, not poses"
    raise InvalidSetting("arm.tip_link", tip_link, expected)


def hand_balls(frame: Frame) -> tuple[Float[np.ndarray, "ball 3"], Float[np.ndarray, " ball"]]:
    """Balls that together contain the hand and its open fingers: centres in a frame of the arm [m], and radii [m]."""
    centres = np.array([(0.0, y, z) for y, z, _ in HAND_BALLS])
    radii = np.array([radius for _, _, radius in HAND_BALLS])
    if frame == "flange":
        cosine, sine = np.cos(HAND_TURN_RAD), np.sin(HAND_TURN_RAD)
        turn = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
        centres = centres @ turn.T + np.array([0, 0, GRASP_TARGET_M])
    return centres, radii
