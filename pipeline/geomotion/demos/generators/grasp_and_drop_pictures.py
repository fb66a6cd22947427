"""Pictures of the scene before the object is grasped, and before it is dropped."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from geomotion.config import GRASP_PLACES, GraspAndDropDataset, ManipulationSkill
from geomotion.demos.demonstrations import Array, Demonstrations
from geomotion.demos.generators.panda_grasp_and_drop import DOWN_WXYZ, GRASP_M, PLACES_M, put
from geomotion.demos.snapshots import BETWEEN, Snapshots

if TYPE_CHECKING:
    from geomotion.robot.tabletop import Tabletop

STREAM = {ManipulationSkill.grasp: 2, ManipulationSkill.drop: 3}  # of random numbers
FARTHEST_ON_THE_WAY = 0.7  # share of the time of a demonstration


@dataclass(frozen=True)
class Situation:
    """A scene before it is seen.

    Attributes:
        place: Number of the place that was meant for the object; -1 anywhere between.
        object_m: Where it lies [m].
        turn_rad: How it is turned [rad].
        joints_rad: Of the arm; None where the hand closes around the object.
        is_on_the_way: Whether the hand has left its place of rest.
    """

    place: int
    object_m: Array
    turn_rad: float
    joints_rad: Array | None
    is_on_the_way: bool


def take(config: GraspAndDropDataset, skill: ManipulationSkill, demonstrations: Demonstrations) -> Snapshots:
    """Pictures of each place, and of the object anywhere between, each in a scenery of its own.

    Before the grasp the hand waits, or is on a demonstrated way, which need not lead to where the object lies: so
    looking again while it moves is nothing new. Before the drop it is closed around the object. The same configuration
    and demonstrations give the same pictures.
    """
    from geomotion.robot.scenery import draw_scenery
    from geomotion.robot.tabletop import Tabletop

    generator = np.random.default_rng((config.seed, STREAM[skill]))
    pictures, seen, objects = [], [], []
    with Tabletop() as tabletop:
        for one in _situations(config, skill, demonstrations, generator):
            tabletop.show(draw_scenery(generator, config.scenery, config.picture_px))
            _arrange(tabletop, one)
            pictures.append(tabletop.picture())
            seen.append(one)
            objects.append(tabletop.object_m()[:2])
    places = np.array([one.place for one in seen])
    return Snapshots(np.stack(pictures), places, np.stack(objects), np.array([one.is_on_the_way for one in seen]))


def anywhere_between(generator: np.random.Generator) -> Array:
    """A random point of the triangle of places [m]."""
    return np.asarray(generator.dirichlet(np.ones(GRASP_PLACES)) @ PLACES_M)


def _situations(
    config: GraspAndDropDataset,
    skill: ManipulationSkill,
    demonstrations: Demonstrations,
    generator: np.random.Generator,
) -> Iterator[Situation]:
    """Those of the places, the hand at rest; those of the places, the hand on its way; those between, half of each."""
    is_grasp = skill is ManipulationSkill.grasp
    at_places, on_the_way = (
        GRASP_PLACES * count for count in (config.snapshots, config.snapshots_on_the_way * is_grasp)
    )
    shown, _ = config.demos_of(ManipulationSkill.grasp)
    for number in range(at_places + on_the_way + config.snapshots_between):
        is_between = number >= at_places + on_the_way
        place = BETWEEN if is_between else number % GRASP_PLACES
        object_m, turn_rad = put(anywhere_between(generator) if is_between else PLACES_M[place], config, generator)
        demonstrated = demonstrations[int(generator.choice(shown))].channels["joints_rad"]
        moves = is_grasp and (number >= at_places) and not (is_between and number % 2)
        share = FARTHEST_ON_THE_WAY * generator.uniform() if moves else 0.0
        joints = demonstrated[int(share * (len(demonstrated) - 1))] if is_grasp else None
        yield Situation(place, object_m, turn_rad, joints, moves)


def _arrange(tabletop: "Tabletop", situation: Situation) -> None:
    from geomotion.robot.inverse_kinematics import solve_pose
    from geomotion.robot.panda import HOME_RAD
    from geomotion.robot.rehearsed import wait
    from geomotion.robot.tabletop import CLOSED_M, CLOSING_S

    if situation.joints_rad is not None:
        tabletop.put_arm(situation.joints_rad)
        tabletop.put_object(situation.object_m, situation.turn_rad)
        return
    held_m = np.array([*situation.object_m, GRASP_M])
    joints = solve_pose(held_m, np.array(DOWN_WXYZ), HOME_RAD).joints_rad[0]
    tabletop.put_arm(joints)
    tabletop.put_object(situation.object_m, situation.turn_rad)
    tabletop.move_fingers(CLOSED_M)
    wait(tabletop, CLOSING_S, joints)
