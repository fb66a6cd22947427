"""Reach to grasp from the side, on the simulated Panda.

The hand starts pointing down, swings by 90° while it reaches, and closes in on an upright object horizontally. The
demonstrations start in one region and reach for three places in turn.

Source:
    Thesis Sec. 3.6.1, Fig. 3.7, which has recordings of a real arm; these are generated.
"""

from dataclasses import dataclass

import numpy as np

from geomotion.config import PandaReachDataset
from geomotion.demos.demonstrations import Array, Demonstrations
from geomotion.demos.generators.human import (
    FRAME,
    LED,
    Habits,
    Intent,
    Quaternion,
    Spread,
    lead_the_arm,
    turned,
)
from geomotion.demos.generators.provenance import generated

START_M = (0.50, -0.40, 0.36)
DOWN_WXYZ: Quaternion = (0.0, 0.5**0.5, 0.5**0.5, 0.0)  # fingers open along x


@dataclass(frozen=True)
class Target:
    """Where an object is grasped [m], and how far the hand then points away from the y axis, about z [rad]."""

    place_m: tuple[float, float, float]
    bearing_rad: float


TARGETS = (
    Target((0.44, 0.16, 0.18), 0.17),
    Target((0.55, 0.12, 0.18), 0.0),
    Target((0.66, 0.06, 0.18), -0.17),
)
APPROACH_M = 0.12  # covered horizontally at last
ARCH_M = (-0.02, -0.02, 0.03)  # by which the way bulges half-way
TURN = (0.1, 0.75)  # the hand has turned before it closes in
HABITS = Habits(position_m=Spread(0.012, 0.016, 0.004), orientation_rad=Spread(0.02, 0.05, 0.03))
WHAT = "reach to grasp on the simulated Panda"


def generate(config: PandaReachDataset) -> Demonstrations:
    """Lead the simulated arm to the targets in turn: poses of its grasp target [m], wxyz, and joints [rad].

    The same configuration gives the same demonstrations; a demonstration does not depend on how many follow it.

    Raises:
        InvalidSetting: If the variation asked for leads out of the arm's reach.
    """
    return generated(
        config,
        (lead_the_arm(intent(number % len(TARGETS)), HABITS, config, number) for number in range(config.demos)),
        WHAT,
        space="R3xS3",
        frame=FRAME,
        steps=(LED,),
    )


def approach(target: Target) -> Array:
    """Direction in which the hand closes in and in which it then points, shape (3,)."""
    return np.array([-np.sin(target.bearing_rad), np.cos(target.bearing_rad), 0.0])


def grasp_wxyz(target: Target) -> Quaternion:
    """Orientation of the hand at a target: pointing along :func:`approach`, fingers opening horizontally."""
    return turned(DOWN_WXYZ, (np.pi / 2, 0.0, 0.0), (0.0, 0.0, target.bearing_rad))


def intent(number: int, start_m: tuple[float, float, float] = START_M) -> Intent:
    """What a hand is meant to do that reaches for target `number`."""
    target = TARGETS[number]
    start, end = np.array(start_m), np.array(target.place_m)
    before = end - APPROACH_M * approach(target)
    half_way = (start + before) / 2 + ARCH_M
    places = np.stack([start, half_way, before, end])
    return Intent(start, places, DOWN_WXYZ, grasp_wxyz(target), TURN, f"to target {number}")
