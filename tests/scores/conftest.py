"""Fields, charts and trajectories with known answers."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from geomotion.dynamics.charts import IdentityChart
from geomotion.dynamics.fields import ChartedField, PushForward
from geomotion.dynamics.linear import LinearField


class ParabolaChart(nn.Module):
    """z = (x, y + x²)."""

    dim = 2

    def to_latent(self, x: Tensor) -> Tensor:
        return torch.stack([x[..., 0], x[..., 1] + x[..., 0] ** 2], dim=-1)

    def to_ambient(self, z: Tensor) -> Tensor:
        return torch.stack([z[..., 0], z[..., 1] - z[..., 0] ** 2], dim=-1)

    def linearise(self, x: Tensor) -> tuple[Tensor, PushForward]:
        def push_forward(v: Tensor) -> Tensor:
            return torch.stack([v[..., 0], v[..., 1] - 2 * x[..., 0] * v[..., 0]], dim=-1)

        return self.to_latent(x), push_forward


def linear_field(rate: float, spin: float, dim: int = 2) -> LinearField:
    """ż = (-rate I + skew) z with the given rotation in the first plane."""
    field = LinearField(dim, rate / 2, rate).double()
    with torch.no_grad():
        field.symmetric_root.copy_(np.sqrt(rate / 2) * torch.eye(dim, dtype=torch.float64))
        field.skew_root[0, 1] = spin
    return field


@pytest.fixture
def spiral() -> Callable[..., ChartedField]:
    """A linear field in the parabola's coordinates: contracting there, not in the plane's own."""

    def make(rate: float = 1.0, spin: float = 2.0, time_unit_s: float = 2.0) -> ChartedField:
        return ChartedField(ParabolaChart(), linear_field(rate, spin), time_unit_s)

    return make


@pytest.fixture
def plain_linear() -> Callable[..., ChartedField]:
    """A linear field in the robot's own coordinates."""

    def make(rate: float = 1.0, spin: float = 0.0, dim: int = 2, time_unit_s: float = 1.0) -> ChartedField:
        return ChartedField(IdentityChart(dim), linear_field(rate, spin, dim), time_unit_s)

    return make
