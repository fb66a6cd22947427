"""Obstacles for states of which only a part is a position."""

import torch

from geomotion.dynamics.charts import IdentityChart
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.linear import LinearField
from geomotion.obstacles.modulation import ModulatedField
from geomotion.obstacles.rollout import rollout_among_obstacles
from geomotion.obstacles.solids import Sphere

FIELD = ChartedField(IdentityChart(6), LinearField(6, 0.5, 1.0).double(), 1.0)
BALL = Sphere(torch.tensor([0.3, 0.0, 0.0], dtype=torch.float64), 0.1)
HELD = torch.zeros(3, dtype=torch.float64)


def modulated() -> ModulatedField:
    return ModulatedField(FIELD, [BALL], held=HELD)


def states(count: int) -> torch.Tensor:
    return torch.randn(count, 6, generator=torch.Generator().manual_seed(0), dtype=torch.float64)


def test_only_the_position_is_turned_aside():
    x = states(50)
    found, free = modulated()(x), FIELD(x)
    torch.testing.assert_close(found[:, 3:], free[:, 3:])
    assert not torch.allclose(found[:, :3], free[:, :3])


def test_where_the_other_coordinates_are_held_it_is_the_modulated_slice():
    x = states(50)
    x[:, 3:] = HELD
    whole = modulated()
    torch.testing.assert_close(whole(x)[:, :3], ModulatedField(whole.moving, [BALL])(x[:, :3]))


def test_no_motion_of_the_position_enters_while_the_rest_moves_on():
    starts = torch.cat([0.3 * states(8)[:, :3] + torch.tensor([0.8, 0.0, 0.0]), states(8)[:, 3:]], dim=1)
    found = rollout_among_obstacles(modulated(), starts, torch.linspace(0, 6, 121, dtype=torch.float64)).states
    assert float(BALL.signed_distance(found[..., :3]).min()) >= 0
    torch.testing.assert_close(found[:, -1], torch.zeros(8, 6, dtype=torch.float64), atol=0.02, rtol=0)
