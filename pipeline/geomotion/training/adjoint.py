"""Fitting trajectories of any field through an adaptive solver, as neural ODEs are (thesis Sec. 5.6.2)."""

from typing import Any

import numpy as np
import torch
from torch import nn
from torchdiffeq import odeint_adjoint

from geomotion.config import AdjointTraining
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.rollout import ADAPTIVE_FAILURES
from geomotion.training.data import Geometry, TrainingSet
from geomotion.training.trainer import Losses
from geomotion.types import Float, States, Tensor, Trajectories


class TrajectoryShooting:
    """Distance between pieces of demonstrations and the field's trajectories from where each piece begins.

    Pieces have one duration and begin at random times. The solver is dopri5 in the chart's coordinates, forwards and,
    by the adjoint method, backwards. Where it gives up, the loss is not a number.

    Args:
        data: Demonstrations.
        geometry: Their size and duration.
        settings: Pieces and tolerances.
    """

    def __init__(self, data: TrainingSet, geometry: Geometry, settings: AdjointTraining) -> None:
        self.settings = settings
        self.scale_m = geometry.scale_m
        shortest_s = min(float(times[-1]) for times in data.times)
        self.duration_s = min(settings.piece * geometry.duration_s, shortest_s)
        self.times_s = torch.linspace(0, self.duration_s, settings.piece_points)
        self.data = data

    def __call__(self, model: ChartedField, progress: float, generator: torch.Generator) -> Losses:
        targets = self._pieces(generator)
        options: dict[str, Any] = {"rtol": self.settings.relative_tolerance, "atol": self.settings.absolute_tolerance}
        limit = {"max_num_steps": self.settings.most_solver_steps}
        try:
            states: Trajectories = odeint_adjoint(
                _RightHandSide(model.field),
                model.chart.to_latent(targets[:, 0]),
                self.times_s / model.time_unit_s,
                method="dopri5",
                options=limit,
                adjoint_options=dict(limit),
                **options,
            ).movedim(0, 1)
        except AssertionError as error:
            if not str(error).startswith(ADAPTIVE_FAILURES):
                raise
            return {"trajectory": torch.tensor(torch.nan)}
        error_m = model.chart.to_ambient(states) - targets
        return {"trajectory": (error_m / self.scale_m).square().sum(-1).mean()}

    def _pieces(self, generator: torch.Generator) -> Float[Tensor, "piece time D"]:
        """Demonstrated states [m], by linear interpolation in time."""
        demos = torch.randint(len(self.data.times), (self.settings.pieces,), generator=generator)
        shares = torch.rand(self.settings.pieces, generator=generator)
        return torch.stack([self._piece(int(demo), float(share)) for demo, share in zip(demos, shares, strict=True)])

    def _piece(self, demo: int, share: float) -> States:
        times, states = self.data.times[demo].numpy(), self.data.states[demo].numpy()
        wanted = share * (times[-1] - self.duration_s) + self.times_s.numpy()
        return torch.as_tensor(np.stack([np.interp(wanted, times, column) for column in states.T], -1)).float()


class _RightHandSide(nn.Module):
    """A field as torchdiffeq wants it; a module, so that its parameters are found."""

    def __init__(self, field: Any) -> None:
        super().__init__()
        self.field = field

    def forward(self, t: Tensor, x: Tensor) -> Tensor:
        velocity: Tensor = self.field(x)
        return velocity
