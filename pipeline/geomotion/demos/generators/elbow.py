"""Several ways of the elbow for one motion of the hand: demonstrations alike at the hand and apart in joint space.

A solution is a swivel angle of the elbow (:mod:`geomotion.robot.swivel`). Where solutions overlap, all elbows are at
the middle angle, and every one leaves it for its own, and comes back, by a minimum-jerk law. People differ in how they
hold the elbow as they do in everything else: a smooth random departure is added.

Source: Thesis Sec. 4.5, where a person led a real arm in several ways; these are computed.
"""

from collections.abc import Sequence

import numpy as np

from geomotion.config import ElbowConfig, JointDataset, Overlap
from geomotion.demos.demonstrations import Array, Demonstrations, Trajectory
from geomotion.demos.generators.human import (
    FRAME,
    Habits,
    Intent,
    Spread,
    minimum_jerk,
    recorded,
    repeat,
    wander,
)
from geomotion.demos.generators.provenance import generated
from geomotion.errors import InvalidSetting
from geomotion.robot.panda import JOINTS

LEAVES, ARRIVES = (
    (0.02, 0.45),
    (0.55, 0.98),
)  # shares of the time in which an elbow goes to its own angle and comes back
HABIT_RAD = Spread(0.04, 0.08, 0.04)
LED = "led the simulated arm along intended poses, the elbow at swivel angles of {degrees} deg; overlap: {overlap}"


def swivels_rad(config: ElbowConfig) -> Array:
    """Swivel angle of every solution [rad], shape (solution,)."""
    reach = config.spread_rad if config.solutions > 1 else 0.0
    return config.swivel_rad + np.linspace(-reach, reach, config.solutions)


def label(config: ElbowConfig, solution: int) -> str:
    """Name of a solution: its swivel angle in whole degrees."""
    return f"elbow {round(np.degrees(swivels_rad(config)[solution])):+d} deg"


def profile_rad(config: ElbowConfig, solution: int, points: int, variation: float, seed: tuple[int, int]) -> Array:
    """Swivel angles of one demonstration, even in time, shape (point,) [rad]; same seed, same angles."""
    share = np.linspace(0.0, 1.0, points)
    own = swivels_rad(config)[solution] - config.swivel_rad
    departure = variation * wander(share, HABIT_RAD, np.random.default_rng((*seed, 1)), axes=1)[:, 0]
    return np.asarray(config.swivel_rad + own * _apart(config.overlap, share) + departure)


def lead_in_turn(config: JointDataset, intents: Sequence[Intent], habits: Habits, what: str) -> Demonstrations:
    """Demonstrations of the simulated Panda in joint space: all solutions of the first intent, of the next, and again.

    ``joints_rad`` [rad] is where the arm was led; ``position_m`` [m] and ``orientation_wxyz`` are where that brings its
    grasp target. A demonstration does not depend on how many follow it.

    Raises:
        InvalidSetting: If one leads out of the arm's reach, or the elbow to where joint limits forbid it to be.
    """
    solutions = config.elbow.solutions
    return generated(
        config,
        (_lead(intents[number // solutions % len(intents)], habits, config, number) for number in range(config.demos)),
        what,
        space="joint",
        frame=FRAME,
        steps=(led(config.elbow),),
        joint_names=JOINTS,
    )


def _lead(intent: Intent, habits: Habits, config: JointDataset, number: int) -> Trajectory:
    from geomotion.robot.redundancy import solve_swivel_path

    time_s, position_m, orientation_wxyz = repeat(intent, habits, config, number)
    solution = number % config.elbow.solutions
    wanted = profile_rad(config.elbow, solution, config.points, config.variation, (config.seed, number))
    found = solve_swivel_path(position_m, orientation_wxyz, wanted)
    if found.path.unreachable:
        expected = f"less: demonstration {number} leads out of the arm's reach"
        raise InvalidSetting("dataset.variation", config.variation, expected)
    if not found.attained.all():
        row = int(found.swivel_error_rad.argmax())
        expected = (
            f"less: joint limits keep the elbow of demonstration {number} from {wanted[row]:.2f} rad in row {row}"
        )
        raise InvalidSetting("dataset.elbow.spread_rad", config.elbow.spread_rad, expected)
    several = config.elbow.solutions > 1
    name = f"{intent.label}, {label(config.elbow, solution)}" if several else intent.label
    return recorded(time_s, found.path.joints_rad, orientation_wxyz, name)


def led(config: ElbowConfig) -> str:
    """What was done to the elbow, as a step of the dataset's record."""
    degrees = ", ".join(f"{round(np.degrees(angle)):+d}" for angle in swivels_rad(config))
    return LED.format(degrees=degrees, overlap=config.overlap.value)


def _apart(overlap: Overlap, share: Array) -> Array:
    """How far an elbow has gone from the common angle to its own, from 0 to 1."""
    leaving, arriving = (minimum_jerk(np.clip((share - a) / (b - a), 0.0, 1.0)) for a, b in (LEAVES, ARRIVES))
    match overlap:
        case Overlap.none:
            return np.ones_like(share)
        case Overlap.start:
            return leaving
        case Overlap.both:
            return leaving - arriving
