"""Ways around obstacles: where f comes together on a surface, one of them leads past it."""

import pytest
import torch
from torch import nn

from geomotion.dynamics.rollout import RolloutStatus
from geomotion.obstacles.modulation import ModulatedField
from geomotion.obstacles.obstacle import Obstacle
from geomotion.obstacles.rollout import rollout_among_obstacles
from geomotion.obstacles.solids import Sphere
from geomotion.obstacles.ways import own_way

GOAL = torch.zeros(3).double()


class Tube(nn.Module):
    """ẋ = -x₁ along the first axis and -k x across it: contracting, and the more so across the faster."""

    def __init__(self, dim: int, rate: float) -> None:
        super().__init__()
        self.dim = dim
        self.rates = torch.tensor([1.0] + [rate] * (dim - 1)).double()

    def forward(self, x):
        return -self.rates * x


def ball(dim: int) -> Obstacle:
    centre = torch.zeros(dim).double()
    centre[0] = 1.0
    return Sphere(centre, 0.3)


def statuses(field: ModulatedField) -> list[RolloutStatus]:
    generator = torch.Generator().manual_seed(0)
    starts = 0.8 * torch.rand(15, field.dim, generator=generator).double() - 0.4
    starts[:, 0] += 2
    times = torch.linspace(0, 15, 31).double()
    return list(rollout_among_obstacles(field, starts, times, goal=GOAL[: field.dim], goal_tolerance=0.05).statuses)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_field_that_comes_together_in_front_of_an_obstacle_stops_there_without_help(dim):
    tube = Tube(dim, 8.0)
    assert RolloutStatus.reached not in statuses(ModulatedField(tube, [ball(dim)], escape=False))
    helped = ModulatedField(tube, [ball(dim)])
    assert helped.ways[0] is not own_way
    assert set(statuses(helped)) == {RolloutStatus.reached}


def test_the_way_of_the_field_is_kept_where_it_leads_past():
    assert ModulatedField(Tube(2, 1.0), [ball(2)]).ways[0] is own_way


def test_states_that_get_on_are_left_alone():
    field, plain = (ModulatedField(Tube(2, 1.0), [ball(2)], escape=escape) for escape in (True, False))
    beside = torch.tensor([[1.0, 0.35], [0.65, 0.1], [1.5, 0.9]]).double()
    torch.testing.assert_close(field(beside), plain(beside))
