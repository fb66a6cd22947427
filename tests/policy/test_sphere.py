"""A ball that is told at run time acts as one that is known beforehand."""

import pytest
import torch
from torch.testing import assert_close

from geomotion.obstacles.modulation import ModulatedField
from geomotion.obstacles.solids import Sphere
from geomotion.obstacles.ways import own_way
from geomotion.policy.sphere import Avoidance, TensorSphere

CENTRE, VELOCITY = torch.tensor([0.1, -0.2, 0.3]), torch.tensor([0.05, 0.0, 0.1])


class Drift(torch.nn.Module):
    dim = 3

    def forward(self, x):
        return torch.tensor([1.0, 0.3, -0.2]) - 2 * x


@pytest.mark.parametrize("hold", [False, True])
@pytest.mark.parametrize("reactivity", [1.0, 3.0])
def test_it_modulates_alike_outside_and_inside(hold, reactivity):
    x = CENTRE + 0.3 * torch.randn(50, 3, generator=torch.Generator().manual_seed(0))
    field = ModulatedField(Drift(), [Sphere(CENTRE, 0.2, VELOCITY)], reactivity, recovery_time_s=0.3, hold=hold)
    assert field.ways == [own_way]
    told = TensorSphere(CENTRE[None], torch.tensor([[0.2]]), VELOCITY[None])
    found = told.modulate(x, Drift()(x), Avoidance(reactivity, True, 0.3, hold))
    assert_close(found, field(x), rtol=1e-5, atol=1e-6)
    assert not torch.allclose(found, Drift()(x), rtol=0.05)


def test_one_without_a_size_is_not_there_even_at_its_centre():
    x = torch.stack([CENTRE, CENTRE + 0.1])
    told = TensorSphere(CENTRE[None], torch.zeros(1, 1), VELOCITY[None])
    assert_close(told.modulate(x, Drift()(x), Avoidance()), Drift()(x), rtol=0, atol=0)
