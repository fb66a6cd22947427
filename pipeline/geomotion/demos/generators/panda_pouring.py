"""Three bottles, three cups, three demonstrated pairs, on the simulated Panda.

A demonstration starts with the hand around an upright bottle, lifts it, carries it across the table and tips it over a
cup. Bottles stand in one row and cups in another; the pairs are crossed, so that all demonstrations pass one place
half-way, with the bottle still upright: there a path may change from one group to another, and all nine pairs of
bottle and cup are feasible.

Source:
    Thesis Sec. 3.6.2, Fig. 3.8, 3.9, which has recordings of a real arm; these are generated.
"""

import numpy as np

from geomotion.config import POURING_GROUPS, PandaPouringDataset
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

BOTTLES_M = ((0.41, 0.20, 0.16), (0.53, 0.20, 0.16), (0.65, 0.20, 0.16))  # where the hand holds them
CUPS_M = ((0.53, -0.12, 0.10), (0.65, -0.12, 0.10), (0.77, -0.12, 0.10))  # middle of the rim
CUP_OF_BOTTLE = (2, 1, 0)  # the demonstrated pairs, one a group
CROSSING_M = (0.53, 0.04, 0.36)
REST_M = (0.55, 0.20, 0.30)
LIFT_M = 0.10
NECK_M = 0.12  # from the hand to the mouth of a bottle
POUR_HEIGHT_M = 0.06  # of the mouth above the rim
TILT_RAD = float(np.radians(95.0))  # about the direction in which the hand points; the mouth goes towards +x
UPRIGHT_WXYZ: Quaternion = (0.5, -0.5, -0.5, -0.5)  # the hand points along y, the bottle in it along z
TURN = (0.62, 0.97)  # the bottle is tipped near the cup only
HABITS = Habits(position_m=Spread(0.005, 0.010, 0.008), orientation_rad=Spread(0.02, 0.035, 0.05))
WHAT = "pouring on the simulated Panda"


def generate(config: PandaPouringDataset) -> Demonstrations:
    """Lead the simulated arm from bottle to cup, groups in turn: poses of its grasp target [m], wxyz, joints [rad].

    The same configuration gives the same demonstrations; a demonstration does not depend on how many follow it.

    Raises:
        InvalidSetting: If the variation asked for leads out of the arm's reach.
    """
    return generated(
        config,
        (lead_the_arm(intent(number % POURING_GROUPS), HABITS, config, number) for number in range(config.demos)),
        WHAT,
        space="R3xS3",
        frame=FRAME,
        steps=(LED,),
    )


def grasp_pose(bottle: int) -> tuple[Array, Quaternion]:
    """Position [m] and orientation of the hand around an upright bottle: where a motion starts."""
    return np.array(BOTTLES_M[bottle]), UPRIGHT_WXYZ


def pour_pose(cup: int) -> tuple[Array, Quaternion]:
    """Position [m] and orientation of the hand with the bottle's mouth above a cup: where a motion ends."""
    neck = np.array([np.sin(TILT_RAD), 0.0, np.cos(TILT_RAD)])
    mouth = np.array(CUPS_M[cup]) + np.array([0.0, 0.0, POUR_HEIGHT_M])
    return mouth - NECK_M * neck, turned(UPRIGHT_WXYZ, (0.0, TILT_RAD, 0.0))


def intent(bottle: int) -> Intent:
    """What a hand is meant to do that pours from a bottle into the cup that belongs to it."""
    cup = CUP_OF_BOTTLE[bottle]
    (start, upright), (end, tipped) = grasp_pose(bottle), pour_pose(cup)
    lift = np.array([0.0, 0.0, LIFT_M])
    places = np.stack([start, start + lift, np.array(CROSSING_M), end + lift, end])
    return Intent(np.array(REST_M), places, upright, tipped, TURN, f"bottle {bottle} to cup {cup}")
