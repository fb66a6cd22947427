"""The swivel angle of the Panda's elbow: which of all joint positions for one pose the arm takes.

The elbow (origin of joint 4) lies on a circle about the line from the shoulder (origin of joint 2) to the wrist (origin
of joint 6). Its angle there is measured from the half-plane of that line that points straight up, right-handed about
the direction from shoulder to wrist: at 0 the elbow is above the line; seen from behind an arm that reaches forwards,
positive angles lead to its right.

Source: M. Shimizu et al. (2008), Analytical inverse kinematic computation for 7-DOF redundant manipulators with joint
limits and its application to redundancy resolution, whose arm angle this is.
"""

import numpy as np

from geomotion.robot.chain import Chain, Joints, panda_chain
from geomotion.types import Float

ELBOW_JOINT, WRIST_JOINT = 3, 5  # counted from 0
SHOULDER_M = np.array([0.0, 0.0, 0.333])  # origin of joints 1 and 2, which no joint moves


def swivel_rad(joints_rad: Joints) -> Float[np.ndarray, "*batch"]:
    """Swivel angle of the elbow [rad], from -π to π; undefined where the wrist is straight above the shoulder."""
    elbow, wrist = (_up_to(joint).pose(joints_rad[..., :joint])[0] for joint in (ELBOW_JOINT, WRIST_JOINT))
    return np.asarray(np.arctan2(*_sine_and_cosine(elbow - SHOULDER_M, wrist - SHOULDER_M)))


def swivel_and_gradient(
    chain: Chain, frames: Float[np.ndarray, "frame 4 4"]
) -> tuple[float, Float[np.ndarray, " joint"]]:
    """Swivel angle [rad] and its derivative by the joint positions, from the frames of the arm's chain."""
    p, dp = _seen_from_shoulder(chain, frames, ELBOW_JOINT)
    w, dw = _seen_from_shoulder(chain, frames, WRIST_JOINT)
    sine, cosine = _sine_and_cosine(p, w)
    length = np.linalg.norm(w)
    d_length = w @ dw / length
    d_sine = sine / length * d_length + length * (p[0] * dw[1] + w[1] * dp[0] - p[1] * dw[0] - w[0] * dp[1])
    d_cosine = 2 * length * d_length * p[2] + length**2 * dp[2] - w[2] * (p @ dw + w @ dp) - (w @ p) * dw[2]
    gradient: Float[np.ndarray, " joint"] = (cosine * d_sine - sine * d_cosine) / (sine**2 + cosine**2)
    return float(np.arctan2(sine, cosine)), gradient


def _sine_and_cosine(
    p: Float[np.ndarray, "*batch 3"], w: Float[np.ndarray, "*batch 3"]
) -> tuple[Float[np.ndarray, "*batch"], Float[np.ndarray, "*batch"]]:
    """Of the angle about w from straight up to p, both times the same positive factor."""
    sine = np.linalg.norm(w, axis=-1) * (p[..., 0] * w[..., 1] - p[..., 1] * w[..., 0])
    cosine = (w * w).sum(axis=-1) * p[..., 2] - (p * w).sum(axis=-1) * w[..., 2]
    return np.asarray(sine), np.asarray(cosine)


def _seen_from_shoulder(
    chain: Chain, frames: Float[np.ndarray, "frame 4 4"], joint: int
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 joint"]]:
    """Place of a joint's origin [m], and its derivative by all joints, of which those before it count [m/rad]."""
    place = frames[joint, :3, 3]
    J = chain.jacobian(frames, place)[:3]
    J[:, joint:] = 0
    return place - SHOULDER_M, J


def _up_to(joint: int) -> Chain:
    """The arm from its base to the origin of a joint."""
    arm = panda_chain("flange")
    return Chain(arm.before[:joint], arm.axes[:joint], arm.before[joint])
