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
        targets, begin_s = self._pieces(generator)
        options: dict[str, Any] = {"rtol": self.settings.relative_tolerance, "atol": self.settings.absolute_tolerance}
        limit = {"max_num_steps": self.settings.most_solver_steps}
        try:
            states: Trajectories = odeint_adjoint(
                _RightHandSide(model, begin_s / model.time_unit_s),
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

    def _pieces(self, generator: torch.Generator) -> tuple[Float[Tensor, "piece time D"], Float[Tensor, "piece 1"]]:
        """Demonstrated states [m], by linear interpolation in time, and when each piece begins [s]."""
        demos = torch.randint(len(self.data.times), (self.settings.pieces,), generator=generator).tolist()
        last_s = torch.stack([self.data.times[demo][-1] for demo in demos])
        begin_s = torch.rand(self.settings.pieces, generator=generator) * (last_s - self.duration_s)
        pieces = [self._piece(demo, float(begin)) for demo, begin in zip(demos, begin_s, strict=True)]
        return torch.stack(pieces), begin_s[:, None]

    def _piece(self, demo: int, begin_s: float) -> States:
        times, states = self.data.times[demo].numpy(), self.data.states[demo].numpy()
        wanted = begin_s + self.times_s.numpy()
        return torch.as_tensor(np.stack([np.interp(wanted, times, column) for column in states.T], -1)).float()


class _RightHandSide(nn.Module):
    """Latent velocities as torchdiffeq wants them; a module, so that parameters of field and time law are found.

    Args:
        model: The field behind its chart.
        begin: When each of a batch of motions is where it starts here, in units of T since its own start.
    """

    def __init__(self, model: ChartedField, begin: Float[Tensor, "piece 1"]) -> None:
        super().__init__()
        self.field: Any = model.field
        self.time_law = model.time_law
        self.paced, self.law_at, self.begin = model.paced, model.law_at, begin

    def forward(self, t: Tensor, z: Tensor) -> Tensor:
        return self.paced(self.field(z), self.begin + t, self.law_at(z))
