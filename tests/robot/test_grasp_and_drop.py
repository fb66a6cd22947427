"""Episodes under policies that see the object by other means than a camera."""

from dataclasses import dataclass

import numpy as np
import pytest

from geomotion.robot.film import Camera, Light
from geomotion.robot.grasp_and_drop import Episodes, Move, Outcome
from geomotion.robot.inverse_kinematics import solve_pose
from geomotion.robot.panda import HOME_RAD
from geomotion.robot.resolved_rate import TipVelocity
from geomotion.robot.scenery import Scenery
from geomotion.robot.tabletop import BIN_M, Tabletop

DOWN = np.array([0.0, 1.0, 0.0, 0.0])
PLACE_M, OTHER_M = np.array([0.45, 0.1]), np.array([0.5, -0.1])
GAIN_PER_S, TOP_M_PER_S = 2.0, 0.3


@dataclass
class Pointed:
    """Goes down a funnel to a goal; a look reads the goal from the simulator."""

    tabletop: Tabletop
    error_m: float = 0.0
    looks: int = 0

    def __post_init__(self):
        self.begin()

    def begin(self):
        self.goal_m = np.zeros(3)

    def look(self, picture):
        assert picture.shape == (32, 32, 3)
        self.looks += 1
        self.goal_m = np.array([*(self.tabletop.object_m()[:2] + np.array([0.0, self.error_m])), 0.022])
        return np.array([1.0])

    def __call__(self, measured, time_s):
        apart = self.goal_m - measured.position_m
        apart[2] += min(5 * np.linalg.norm(apart[:2]), 0.18)
        return TipVelocity(limited(GAIN_PER_S * apart), np.zeros(3))


class OverBin(Pointed):
    def look(self, picture):
        self.goal_m = np.array([*BIN_M, 0.22])
        return np.array([1.0])

    def __call__(self, measured, time_s):
        apart = self.goal_m - measured.position_m
        if measured.position_m[2] < 0.15:
            apart[:2] = 0
        return TipVelocity(limited(GAIN_PER_S * apart), np.zeros(3))


def limited(velocity):
    return velocity * min(1.0, TOP_M_PER_S / max(np.linalg.norm(velocity), 1e-9))


@pytest.fixture(scope="module")
def tabletop():
    with Tabletop() as scene:
        scene.show(Scenery(Camera(width=32, height=32, light=Light()), (0.9, 0.3, 0.3), (0.8, 0.7, 0.6), 1))
        yield scene


@pytest.fixture(scope="module")
def rest_rad():
    return solve_pose(np.array([0.36, 0.0, 0.35]), DOWN, HOME_RAD).joints_rad[0]


def test_an_object_is_lifted_and_dropped_into_the_bin(tabletop, rest_rad):
    tabletop.put_object(PLACE_M, 0.1)
    done = Episodes(tabletop, Pointed(tabletop), OverBin(tabletop), rest_rad).run()
    assert done.outcome is Outcome.dropped_in_bin and done.succeeded and tabletop.is_in_bin()
    assert done.looks > 3


def test_an_object_that_is_missed_stays_where_it_is(tabletop, rest_rad):
    tabletop.put_object(PLACE_M)
    done = Episodes(tabletop, Pointed(tabletop, error_m=0.12), OverBin(tabletop), rest_rad).run()
    assert done.outcome is Outcome.not_grasped and not done.succeeded
    np.testing.assert_allclose(tabletop.object_m()[:2], PLACE_M, atol=0.01)


def test_an_object_that_is_moved_is_looked_for_again(tabletop, rest_rad):
    for looks_per_s, expected in ((4.0, Outcome.dropped_in_bin), (0.0, Outcome.not_grasped)):
        tabletop.put_object(PLACE_M)
        loop = Episodes(tabletop, Pointed(tabletop), OverBin(tabletop), rest_rad, looks_per_s=looks_per_s)
        done = loop.run((Move(0.2, OTHER_M),))
        assert done.outcome is expected
        np.testing.assert_allclose(done.object_m[:2], OTHER_M, atol=0.01)
