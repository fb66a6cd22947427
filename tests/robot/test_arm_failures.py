"""How often an arm touches an obstacle that its hand keeps clear of."""

import numpy as np
import pytest
import torch

from geomotion.obstacles.solids import Sphere
from geomotion.robot.arm_failures import arm_failures
from geomotion.robot.panda_arm import panda_arm
from geomotion.robot.scene import ArmScene

POSITIONS_M = np.array([[0.5, 0.0, 0.3], [2.0, 0.0, 0.3]])  # the second is out of reach
DOWN = np.tile([0.0, 1.0, 0.0, 0.0], (2, 1))


def failures(centre_m: list[float], radius_m: float, count: int = 12):
    with ArmScene(panda_arm()) as scene:
        scene.add_obstacle("sphere", Sphere(torch.tensor(centre_m, dtype=torch.float64), radius_m))
        return arm_failures(scene, POSITIONS_M, DOWN, count)


@pytest.mark.parametrize(
    ("centre_m", "share"),
    [([0.0, 3.0, 0.0], 0.0), ([0.5, 0.0, 0.35], 1.0)],
    ids=["far away", "where the hand is"],
)
def test_all_or_no_solutions_touch_what_is_at_the_hand_or_far_away(centre_m, share):
    found = failures(centre_m, 0.05)
    assert found.share[0] == share
    assert found.solutions[1] == 0 and np.isnan(found.share[1])


def test_some_solutions_touch_what_is_beside_the_arm():
    found = failures([0.3, -0.15, 0.6], 0.08)
    assert 0 < found.touching[0] < found.solutions[0] <= 12
