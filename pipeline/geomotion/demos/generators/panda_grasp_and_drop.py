"""Grasp a soft-looking object on the table and drop it into a bin, on the simulated Panda.

The hand points down throughout. It comes from one region, closes in on the object from above, takes it by friction,
carries it over the bin and lets go. Intended motions are human-like; the arm executes them in simulation, and what is
recorded is where it was. A repetition counts only if the object was held by both fingers and ended in the bin.

Source:
    Thesis Sec. 6.4.8, Fig. 6.16, which has recordings and photographs of a real arm; these are generated.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from geomotion.config import GRASP_PLACES, GraspAndDropDataset, ManipulationSkill
from geomotion.demos.demonstrations import Array, Demonstrations, Trajectory
from geomotion.demos.generators.human import FRAME, Habits, Intent, Quaternion, Spread, recorded, repeat
from geomotion.demos.generators.provenance import generated
from geomotion.errors import InvalidSetting

if TYPE_CHECKING:
    from geomotion.robot.tabletop import Tabletop

PLACES_M = np.array([(0.42, 0.20), (0.62, 0.04), (0.45, -0.14)])  # of the object, on the table
REST_M = (0.34, 0.02, 0.42)  # where the hand waits
GRASP_M, ABOVE_M, LIFT_M = 0.022, (0.16, 0.08), 0.12  # heights of the hand
OVER_BIN_M, CROSSING_M = (0.34, -0.46, 0.24), (0.42, -0.20, 0.32)
DOWN_WXYZ: Quaternion = (0.0, 1.0, 0.0, 0.0)  # fingers open along y
NO_TURN = (0.0, 1.0)
GRASP_HABITS = Habits(position_m=Spread(0.010, 0.008, 0.0015), orientation_rad=Spread(0.0, 0.0, 0.0))
DROP_HABITS = Habits(position_m=Spread(0.0, 0.010, 0.006), orientation_rad=Spread(0.0, 0.0, 0.0))
PLACE_STD_M, TURN_STD_RAD = 0.003, 0.10  # how exactly a person puts the object where it belongs
SOLVED_POSES = 100  # of a motion, by inverse kinematics; joints follow a spline between them
NAMES = tuple(f"place_{number}" for number in range(1, GRASP_PLACES + 1))
WHAT = "grasp and drop on the simulated Panda"
STEP = (
    "executed intended motions on the simulated arm, which held the object by friction and dropped it into the bin; "
    "positions are measured there, evenly in time"
)


@dataclass(frozen=True)
class Repetition:
    """One time that the object was grasped and dropped."""

    grasp: Trajectory
    drop: Trajectory


def generate(config: GraspAndDropDataset) -> Demonstrations:
    """All demonstrations of the grasp, place after place, then those of the drop: positions [m], wxyz, joints [rad].

    The condition is the place, one entry for each. The same configuration gives the same demonstrations.

    Raises:
        InvalidSetting: If the variation asked for leads out of the arm's reach, or makes it lose the object.
    """
    from geomotion.robot.tabletop import Tabletop

    with Tabletop() as tabletop:
        done = [
            _demonstrate(tabletop, config, place, place * config.demos + repetition)
            for place in range(GRASP_PLACES)
            for repetition in range(config.demos)
        ]
    return generated(
        config,
        [getattr(one, skill.value) for skill in ManipulationSkill for one in done],
        WHAT,
        space="R3",
        frame=FRAME,
        steps=(STEP,),
        condition_names=NAMES,
    )


def put(place_m: Array, config: GraspAndDropDataset, generator: np.random.Generator) -> tuple[Array, float]:
    """Where a person puts the object who means a place [m], and how far it is turned [rad]."""
    offset = config.variation * PLACE_STD_M * generator.standard_normal(2)
    return place_m + offset, float(config.variation * TURN_STD_RAD * generator.standard_normal())


def _demonstrate(tabletop: "Tabletop", config: GraspAndDropDataset, place: int, number: int) -> Repetition:
    from geomotion.robot.rehearsed import wait
    from geomotion.robot.tabletop import CLOSED_M, CLOSING_S, FALLING_S, OPEN_M

    where, turn_rad = put(PLACES_M[place], config, np.random.default_rng((config.seed, number, 1)))
    tabletop.put_object(where, turn_rad)
    down = np.array([*where, GRASP_M])
    above = [np.array([*where, height]) for height in ABOVE_M]
    rest = np.array(REST_M)
    grasping = _intent(rest, np.stack([rest, *above, down]), f"grasp, place {place + 1}")
    grasp = _executed(tabletop, config, grasping, GRASP_HABITS, number, None)
    joints = grasp.channels["joints_rad"][-1]
    tabletop.move_fingers(CLOSED_M)
    wait(tabletop, CLOSING_S, joints)
    start = grasp.channels["position_m"][-1]
    lifted = start + np.array([0.0, 0.0, LIFT_M])
    dropping = _intent(start, np.stack([start, lifted, CROSSING_M, OVER_BIN_M]), f"drop, place {place + 1}")
    drop = _executed(tabletop, config, dropping, DROP_HABITS, GRASP_PLACES * config.demos + number, joints)
    was_held = tabletop.is_held()
    tabletop.move_fingers(OPEN_M)
    wait(tabletop, FALLING_S, drop.channels["joints_rad"][-1])
    if not (was_held and tabletop.is_in_bin()):
        lost = "lets the object fall beside the bin" if was_held else "loses the object"
        raise InvalidSetting("dataset.variation", config.variation, f"less: demonstration {number} {lost}")
    condition = tuple(float(one == place) for one in range(GRASP_PLACES))
    return Repetition(replace(grasp, condition=condition), replace(drop, condition=condition))


def _intent(rest: Array, places: Array, label: str) -> Intent:
    return Intent(rest, places, DOWN_WXYZ, DOWN_WXYZ, NO_TURN, label)


def _executed(
    tabletop: "Tabletop",
    config: GraspAndDropDataset,
    intent: Intent,
    habits: Habits,
    number: int,
    start_rad: Array | None,
) -> Trajectory:
    """Repetition `number` of a motion as the arm executes it, from where it is, or from the motion's start."""
    from geomotion.robot.inverse_kinematics import solve_path_from
    from geomotion.robot.panda import HOME_RAD
    from geomotion.robot.rehearsed import execute

    time_s, position_m, orientation_wxyz = repeat(intent, habits, config, number)
    rows = np.linspace(0, len(time_s) - 1, min(SOLVED_POSES, len(time_s))).round().astype(int)
    near = HOME_RAD if start_rad is None else start_rad
    path = solve_path_from(near, position_m[rows], orientation_wxyz[rows])
    if path.unreachable:
        expected = f"less: demonstration {number} leads out of the arm's reach"
        raise InvalidSetting("dataset.variation", config.variation, expected)
    if start_rad is None:
        tabletop.put_arm(path.joints_rad[0])
    done = execute(tabletop, time_s[rows], path.joints_rad)
    sampled = np.stack([np.interp(time_s, done.time_s, column) for column in done.joints_rad.T], axis=1)
    return recorded(time_s, sampled, orientation_wxyz, intent.label)
