"""Guarded rollouts: accuracy against a closed form, and that none of them enters any of ten obstacle sets."""

import pytest
import torch
from torch import nn
from torch.testing import assert_close

from geomotion.dynamics.rollout import RolloutStatus
from geomotion.obstacles.guarded import GuardedSolver
from geomotion.obstacles.modulation import ModulatedField
from geomotion.obstacles.rollout import rollout_among_obstacles
from geomotion.obstacles.solids import Sphere

from .obstacle_sets import obstacle_sets

STARTS = 30
ROUNDING = 1e-12
SETS = obstacle_sets()


class Turning(nn.Module):
    """ẋ = A x with A = -I and a turn between the first two axes."""

    def __init__(self, dim: int, turn: float, dtype: torch.dtype = torch.float64) -> None:
        super().__init__()
        self.dim = dim
        self.matrix = -torch.eye(dim, dtype=dtype)
        self.matrix[0, 1], self.matrix[1, 0] = turn, -turn

    def forward(self, x):
        return x @ self.matrix.T


def test_far_from_obstacles_trajectories_are_those_of_the_field_at_all_wanted_times():
    field = ModulatedField(Turning(2, 2.0), [Sphere(torch.tensor([1e4, 0.0]).double(), 1e-3)], escape=False)
    start = torch.tensor([[1.0, 0.5]]).double()
    for wanted, tolerance, expected in ((301, 1e-4, 1e-6), (7, 1e-9, 1e-8)):
        times = torch.linspace(0, 3, wanted).double()
        found = GuardedSolver(field, 0.0, tolerance).solve(start, times)[0]
        exact = torch.linalg.matrix_exp(field.field.matrix * times[:, None, None]) @ start[0]
        assert_close(found, exact, atol=expected, rtol=0)


@pytest.mark.parametrize("name", SETS)
def test_random_starts_stay_outside_and_reach_the_goal(name):
    obstacles = SETS[name]
    dim = obstacles[0].dim
    generator = torch.Generator().manual_seed(0)
    starts = 3 * torch.rand(4 * STARTS, dim, generator=generator).double() - torch.tensor([0.5, 1.5, 1.5][:dim])
    starts = starts[torch.stack([obstacle.level(starts) > 1 for obstacle in obstacles]).all(dim=0)][:STARTS]
    starts[0] = torch.tensor([2.0, 0.0, 0.0][:dim])  # heads for the middle
    times = torch.linspace(0, 8, 17).double()
    field = ModulatedField(Turning(dim, 0.3), obstacles)
    found = rollout_among_obstacles(field, starts, times, goal=torch.zeros(dim).double(), goal_tolerance=0.05)
    assert not found.note
    for obstacle in obstacles:
        assert obstacle.level(found.states - obstacle.velocity * times[:, None]).min() > 1 - ROUNDING
    assert sum(status is RolloutStatus.reached for status in found.statuses) >= 0.99 * len(starts)


def test_a_step_too_long_for_fixed_steps_is_kept_outside():
    sphere = Sphere(torch.tensor([1.0, 0.05]).double(), 0.3)
    field = ModulatedField(Turning(2, 0.0), [sphere])
    times, start = torch.tensor([0.0, 1.0, 2.0]).double(), torch.tensor([[1.6, 0.0]]).double()
    found = rollout_among_obstacles(field, start, times)
    fine = rollout_among_obstacles(field, start, times, method="rk4", substeps=100)
    assert sphere.level(found.states).min() > 1 - ROUNDING
    assert_close(found.states, fine.states, atol=1e-3, rtol=0)


def test_single_precision_stays_outside_up_to_its_rounding():
    sphere = Sphere(torch.tensor([1.0, 0.0]), 0.3)
    field = ModulatedField(Turning(2, 0.0, torch.float32), [sphere])
    starts = torch.tensor([[1.6, 0.0], [2.0, 0.01], [1.3, 0.2]])
    found = rollout_among_obstacles(field, starts, torch.linspace(0, 8, 41))
    assert sphere.level(found.states).min() > 1 - 1e-5
