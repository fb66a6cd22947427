"""Motions of the simulated Panda in joint space, with several ways of the elbow.

Reach to grasp and pouring are those of ``panda_reach`` and ``panda_pouring``; a third goes round a circle, back to
where it began.

Source:
    Thesis Sec. 4.5, Fig. 4.3, 4.5, 4.7 to 4.9, which has recordings of a real arm; these are generated.
"""

import numpy as np

from geomotion.config import (
    POURING_GROUPS,
    PandaCircleJointDataset,
    PandaPouringJointDataset,
    PandaReachJointDataset,
)
from geomotion.demos.demonstrations import Demonstrations
from geomotion.demos.generators import panda_pouring, panda_reach
from geomotion.demos.generators.elbow import lead_in_turn
from geomotion.demos.generators.human import Habits, Intent, Spread
from geomotion.demos.generators.panda_reach import DOWN_WXYZ

REACH_START_M = (
    0.60,
    -0.40,
    0.30,
)  # further out than in panda_reach: there the upper arm stands upright, a singularity
CENTRE_M = (0.60, 0.0, 0.12)
PLACES = 17  # that the circle is drawn through, first and last the same
CIRCLE_HABITS = Habits(position_m=Spread(0.004, 0.006, 0.004), orientation_rad=Spread(0.02, 0.03, 0.02))
CIRCLE_WHAT = "circle of the simulated Panda's hand"


def reach_to_grasp(config: PandaReachJointDataset) -> Demonstrations:
    """From one region to the targets; see :func:`elbow.lead_in_turn`."""
    intents = [panda_reach.intent(target, REACH_START_M) for target in config.targets]
    return lead_in_turn(config, intents, panda_reach.HABITS, panda_reach.WHAT)


def pouring(config: PandaPouringJointDataset) -> Demonstrations:
    """From bottle to cup, through one place half-way; see :func:`elbow.lead_in_turn`."""
    intents = [panda_pouring.intent(bottle) for bottle in range(POURING_GROUPS)]
    return lead_in_turn(config, intents, panda_pouring.HABITS, panda_pouring.WHAT)


def circle(config: PandaCircleJointDataset) -> Demonstrations:
    """Once round a level circle, the hand pointing down; see :func:`elbow.lead_in_turn`."""
    angle = np.linspace(0.0, 2 * np.pi, PLACES)
    places = CENTRE_M + config.radius_m * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    intent = Intent(places[0], places, DOWN_WXYZ, DOWN_WXYZ, (0.0, 1.0), "circle")
    return lead_in_turn(config, [intent], CIRCLE_HABITS, CIRCLE_WHAT)
