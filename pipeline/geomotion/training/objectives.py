"""Losses that fields are fitted with."""

import torch

from geomotion.dynamics.fields import ChartedField
from geomotion.training.data import Geometry, TrainingSet
from geomotion.training.trainer import Losses


class VelocityReconstruction:
    """Mean squared velocity error, Eq. (5.3), in units of the data's size and duration, and the regulariser's loss.

    Args:
        data: Demonstrated states and velocities.
        geometry: Their size and duration, which make the loss free of units.
        batch_points: Points drawn in each step.
    """

    def __init__(self, data: TrainingSet, geometry: Geometry, batch_points: int) -> None:
        self.states = data.all_states
        self.velocities = data.all_velocities
        self.batch_points = min(batch_points, len(self.states))
        self.speed_m_per_s = geometry.scale_m / geometry.duration_s

    def __call__(self, model: ChartedField, progress: float, generator: torch.Generator) -> Losses:
        chosen = torch.randint(len(self.states), (self.batch_points,), generator=generator)
        error = (model(self.states[chosen]) - self.velocities[chosen]) / self.speed_m_per_s
        losses = {"velocity": error.square().sum(-1).mean()}
        regulariser = getattr(model.field, "regulariser", None)
        if regulariser is not None:
            losses["regulariser"] = regulariser.loss()
        return losses
