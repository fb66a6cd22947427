"""What a field takes from the demonstrations before, or instead of, its training."""

from typing import Protocol, runtime_checkable

import torch
from torch.func import jvp

from geomotion.dynamics.fields import ChartedField
from geomotion.training.data import Geometry, TrainingSet
from geomotion.types import Curves


@runtime_checkable
class StartsFromData(Protocol):
    """A field with parameters that depend on what was shown before the first step."""

    def start_from(self, times: Curves, states: Curves, velocities: Curves) -> None:
        """Set the parameters; one entry for each demonstration, in the field's own coordinates and time unit."""
        ...


@torch.no_grad()
def start_from_data(model: ChartedField, data: TrainingSet) -> bool:
    """Let a field start from demonstrations; whether it does."""
    if not isinstance(model.field, StartsFromData):
        return False
    states, velocities = [], []
    for shown, moving in zip(data.states, data.velocities, strict=True):
        z, rate = jvp(model.chart.to_latent, (shown,), (moving * model.time_unit_s,))[:2]
        states.append(z)
        velocities.append(rate)
    model.field.start_from([times / model.time_unit_s for times in data.times], states, velocities)
    return True


@torch.no_grad()
def mean_square_distance(model: ChartedField, data: TrainingSet, geometry: Geometry) -> float:
    """Of solvable fields, at equal times, in units of the demonstrations' size."""
    shown = zip(data.times, data.states, strict=True)
    offsets = [(model.solve(states[:1], times)[0] - states) / geometry.scale_m for times, states in shown]
    return float(torch.cat(offsets).square().sum(-1).mean())
