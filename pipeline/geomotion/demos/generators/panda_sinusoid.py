"""A wave drawn on a table by the simulated Panda, whose hand points down throughout.

Source:
    Thesis Sec. 6.4.5, Fig. 6.13, left, which has seven recordings of a real arm; these are generated.
"""

import numpy as np

from geomotion.config import PandaSinusoidDataset
from geomotion.demos.demonstrations import Demonstrations
from geomotion.demos.generators.human import FRAME, LED, Habits, Intent, Quaternion, Spread, lead_the_arm
from geomotion.demos.generators.provenance import generated

START_M, END_M = (0.50, -0.25, 0.15), (0.50, 0.25, 0.15)
AMPLITUDE_M = 0.08  # away from the arm and back
PERIODS = 1.5
PLACES = 25  # of the wave, through which the spline goes
DOWN_WXYZ: Quaternion = (0.0, 1.0, 0.0, 0.0)
HABITS = Habits(position_m=Spread(0.010, 0.010, 0.003), orientation_rad=Spread(0.0, 0.0, 0.0))
WHAT = "a wave drawn by the simulated Panda"


def generate(config: PandaSinusoidDataset) -> Demonstrations:
    """Lead the simulated arm along the wave: poses of its grasp target [m], wxyz, and joints [rad].

    Raises:
        InvalidSetting: If the variation asked for leads out of the arm's reach.
    """
    return generated(
        config,
        (lead_the_arm(intent(), HABITS, config, number) for number in range(config.demos)),
        WHAT,
        space="R3xS3",
        frame=FRAME,
        steps=(LED,),
    )


def intent() -> Intent:
    """The wave that a hand is meant to draw."""
    along = np.linspace(0.0, 1.0, PLACES)
    places = np.array(START_M) + np.outer(along, np.subtract(END_M, START_M))
    places[:, 0] += AMPLITUDE_M * np.sin(2 * np.pi * PERIODS * along)
    return Intent(np.array(START_M), places, DOWN_WXYZ, DOWN_WXYZ, (0.0, 1.0), "wave")
