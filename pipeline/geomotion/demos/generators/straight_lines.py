"""Straight lines that end in one point: demonstrations of ẋ = -k x, whose contraction is the same in every direction.

Source:
    Thesis Sec. 5.6.2, Fig. 5.13.
"""

import numpy as np

from geomotion.config import StraightLinesDataset
from geomotion.demos.demonstrations import Array, Demonstrations, Trajectory
from geomotion.demos.generators.provenance import generated

GOLDEN_ANGLE_RAD = np.pi * (3 - 5**0.5)  # spreads any number of starts over the circle
ANGLE_SPREAD_RAD = 0.1
SIZE_SPREAD = 0.06
WHAT = "straight lines to one point"


def generate(config: StraightLinesDataset) -> Demonstrations:
    """Exponential decay from starts on a circle: ``position_m`` [m] and ``velocity_m_per_s`` [m/s].

    The same configuration gives the same demonstrations; a demonstration does not depend on how many follow it.
    """
    rate_per_s = -np.log(config.final_share) / config.duration_s
    time_s = np.linspace(0.0, config.duration_s, config.points)
    trajectories = []
    for number in range(config.demos):
        position_m = np.exp(-rate_per_s * time_s)[:, None] * _start(number, config)
        trajectories.append(
            Trajectory(time_s, {"position_m": position_m, "velocity_m_per_s": -rate_per_s * position_m})
        )
    return generated(config, trajectories, WHAT, space="R2", frame="plane, origin at the target")


def _start(number: int, config: StraightLinesDataset) -> Array:
    turn, size = np.random.default_rng((config.seed, number)).normal(size=2) * config.variation
    angle = number * GOLDEN_ANGLE_RAD + ANGLE_SPREAD_RAD * turn
    radius = config.size_m * np.exp(SIZE_SPREAD * size)
    return np.asarray(radius * np.array([np.cos(angle), np.sin(angle)]))
