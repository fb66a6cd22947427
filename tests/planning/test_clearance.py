"""Bounds of what a path keeps clear of, against looks that are much closer together."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from geomotion.obstacles.motion import ConstantVelocity, MovingBody
from geomotion.obstacles.solids import Box, Sphere
from geomotion.planning.clearance import TOLERANCE_M, kept_clearances
from geomotion.planning.obstruction import Tool, distances
from geomotion.scores.paths import PosePath, of_one_sign

TOOL = Tool(np.array([[0.0, 0.0, 0.1], [0.0, 0.05, 0.0]]), np.array([0.02, 0.03]))


def path(seed: int, steps: int = 6) -> PosePath:
    generator = np.random.default_rng(seed)
    turns = Rotation.from_rotvec(np.cumsum(0.3 * generator.normal(size=(steps + 1, 3)), axis=0))
    position_m = np.cumsum(0.1 * generator.normal(size=(steps + 1, 3)), axis=0)
    return PosePath(position_m, of_one_sign(turns.as_quat(scalar_first=True)))


def bodies(seed: int) -> list[MovingBody]:
    place = torch.from_numpy(np.random.default_rng(100 + seed).uniform(-0.3, 0.3, 3))
    return [
        MovingBody("sphere", Sphere(place, 0.05), ConstantVelocity(np.array([0.1, 0.0, 0.0]))),
        MovingBody("box", Box(place + 0.4, [0.1, 0.2, 0.05], 0.005), ConstantVelocity(np.zeros(3))),
    ]


def looks(states: PosePath, seed: int, time_s: float, horizon_s: float, closeness: int = 200) -> np.ndarray:
    """Distances at many states of each step, shape (step, look)."""
    dense = states.resampled(closeness * (len(states) - 1) + 1)
    apart = distances(bodies(seed), TOOL.points(dense), TOOL.radii_m, time_s, horizon_s).min(axis=0)
    return np.stack([apart[step * closeness : (step + 1) * closeness + 1] for step in range(len(states) - 1)])


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(("time_s", "horizon_s"), [(0.0, 0.0), (0.7, 0.5)])
def test_every_bound_is_kept_and_the_smallest_is_nearly_the_clearance(seed, time_s, horizon_s):
    states = path(seed)
    kept = kept_clearances(states, TOOL, bodies(seed), time_s, horizon_s)
    truth = looks(states, seed, time_s, horizon_s)
    assert (kept <= truth.min(axis=1) + 1e-9).all()
    assert kept.min() >= truth.min() - TOLERANCE_M


@pytest.mark.parametrize("seed", range(8))
def test_with_enough_room_a_looser_bound_will_do(seed):
    """What is said to keep that much does, and what does not is not called enough."""
    states = path(seed)
    truth = looks(states, seed, 0.0, 0.0).min(axis=1)
    enough_m = float(np.quantile(truth, 0.5))
    kept = kept_clearances(states, TOOL, bodies(seed), 0.0, enough_m=enough_m)
    assert (kept <= truth + 1e-9).all()
    assert (kept.min() >= enough_m) == (kept_clearances(states, TOOL, bodies(seed), 0.0).min() >= enough_m)


def test_a_single_state_keeps_its_own_distance():
    states = path(0)[:1]
    (kept,) = kept_clearances(states, TOOL, bodies(0), 0.0)
    assert kept == distances(bodies(0), TOOL.points(states), TOOL.radii_m, 0.0).min()


def test_a_long_step_through_an_obstacle_is_noticed():
    """Both ends are far from it, and so is every state that is looked at first."""
    upright = np.tile([1.0, 0, 0, 0], (2, 1))
    states = PosePath(np.array([[-1.0, 0, 0], [1.0, 0, 0]]), upright)
    ball = MovingBody("ball", Sphere(torch.tensor([0.31, 0.0, 0.0]).double(), 0.01), ConstantVelocity(np.zeros(3)))
    (kept,) = kept_clearances(states, Tool(), [ball], 0.0)
    assert -0.01 - TOLERANCE_M <= kept <= -0.01
