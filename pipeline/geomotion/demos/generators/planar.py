"""A planar arm of two links whose tip follows an S, with both solutions of its inverse kinematics.

The S is that of :mod:`geomotion.demos.generators.letters`. Every repetition is followed twice, elbow up and elbow down:
the same movement of the tip, in two places of joint space.

Source:
    Thesis Sec. 4.3, Fig. 4.1.
"""

import numpy as np

from geomotion.config import LettersDataset, PlanarSCurveDataset
from geomotion.demos.demonstrations import Array, Demonstrations, Trajectory
from geomotion.demos.generators import letters
from geomotion.demos.generators.provenance import generated
from geomotion.errors import InvalidSetting

LINKS_M = (0.30, 0.25)  # those of robot/urdf/planar_2dof.urdf, as are the names of its joints
JOINTS = ("shoulder", "elbow")
END_M = (0.28, -0.10)  # of the S, in the frame of the base
BRANCHES = {"elbow up": -1.0, "elbow down": 1.0}  # sign of the elbow's angle
WHAT = "planar arm that follows an S"


def generate(config: PlanarSCurveDataset) -> Demonstrations:
    """Follow the letter with both branches in turn: ``joints_rad`` [rad], and ``position_m`` of the tip [m].

    The same configuration gives the same demonstrations; a demonstration does not depend on how many follow it.

    Raises:
        InvalidSetting: If the letter is too large for the arm.
    """
    strokes = _write(config)
    branches = list(BRANCHES)
    return generated(
        config,
        (_follow(strokes[number // 2], branches[number % 2], config) for number in range(config.demos)),
        WHAT,
        space="joint",
        frame="base of the planar arm",
        steps=("joints_rad are derived from intended places of the tip by inverse kinematics in closed form",),
        joint_names=JOINTS,
    )


def joints_rad(position_m: Array, elbow_sign: float) -> Array:
    """Angles of shoulder and elbow that bring the tip to places within reach, shape (point, 2); NaN beyond it."""
    a, b = LINKS_M
    x, y = position_m.T
    with np.errstate(invalid="ignore"):
        elbow = elbow_sign * np.arccos((x**2 + y**2 - a**2 - b**2) / (2 * a * b))
    shoulder = np.arctan2(y, x) - np.arctan2(b * np.sin(elbow), a + b * np.cos(elbow))
    return np.stack([shoulder, elbow], axis=1)


def _follow(stroke: Trajectory, branch: str, config: PlanarSCurveDataset) -> Trajectory:
    place_m = stroke.channels["position_m"] + END_M
    joints = joints_rad(place_m, BRANCHES[branch])
    if not np.isfinite(joints).all():
        raise InvalidSetting("dataset.size_m", config.size_m, f"less: the arm reaches {sum(LINKS_M)} m")
    return Trajectory(stroke.time_s, {"position_m": place_m, "joints_rad": joints}, branch)


def _write(config: PlanarSCurveDataset) -> tuple[Trajectory, ...]:
    settings = LettersDataset(
        name=config.name,
        letter="s",
        size_m=config.size_m,
        seed=config.seed,
        demos=(config.demos + 1) // 2,
        points=config.points,
        duration_s=config.duration_s,
        variation=config.variation,
    )
    return letters.generate(settings).trajectories
