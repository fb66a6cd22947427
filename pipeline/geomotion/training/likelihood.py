"""Likelihood of demonstrated transitions under stochastic dynamics in a flow's coordinates."""

import torch

from geomotion.baselines.imitation_flow import StochasticDrift
from geomotion.config import LikelihoodTraining
from geomotion.dynamics.fields import ChartedField, PushForward
from geomotion.training.data import Geometry, TrainingSet
from geomotion.training.trainer import Losses
from geomotion.types import Float, Latent, Tensor


class TransitionLikelihood:
    r"""Mean negative log density of a state some time after another of the same demonstration.

    .. math:: \log p(x' \mid x) = \log p(\psi(x') \mid \psi(x)) + \log |\det D\psi(x')|

    The time between both is random, up to `longest_step`.

    Args:
        data: Demonstrations.
        geometry: Their size and duration; densities are those of states in units of the size.
        settings: Sample size and longest time.

    Source: Urain, Ginesi, Tateo and Peters, 2020, ImitationFlow.
    """

    def __init__(self, data: TrainingSet, geometry: Geometry, settings: LikelihoodTraining) -> None:
        self.settings = settings
        self.states = data.all_states
        self.times = torch.cat(data.times) / geometry.duration_s
        self.log_scale = float(torch.tensor(geometry.scale_m).log())
        lengths = torch.tensor([len(times) for times in data.times])
        self.last = (lengths.cumsum(0) - 1).repeat_interleave(lengths)  # of the demonstration that a point belongs to
        self.begins = torch.nonzero(torch.arange(len(self.last)) < self.last)[:, 0]
        mean_step = float(torch.stack([times.diff().mean() for times in data.times]).mean()) / geometry.duration_s
        self.most_points = max(1, round(settings.longest_step / mean_step))

    def __call__(self, model: ChartedField, progress: float, generator: torch.Generator) -> Losses:
        assert isinstance(model.field, StochasticDrift)
        count = self.settings.batch_points
        begin = self.begins[torch.randint(len(self.begins), (count,), generator=generator)]
        step = torch.randint(1, self.most_points + 1, (count,), generator=generator)
        end = torch.minimum(begin + step, self.last[begin])
        z = model.chart.to_latent(self.states[begin])
        later, push_forward = model.chart.linearise(self.states[end])
        density = model.field.log_transition(z, later, self.times[end] - self.times[begin])
        volume = log_volume(later, push_forward) + later.shape[-1] * self.log_scale
        return {"negative_log_likelihood": -(density + volume).mean()}


def log_volume(z: Latent, push_forward: PushForward) -> Float[Tensor, " point"]:
    """log |det Dψ| from what a chart's `linearise` gives."""
    units = torch.eye(z.shape[-1], dtype=z.dtype)[:, None].expand(-1, len(z), -1)
    columns: Tensor = push_forward(units).movedim(0, -1)
    volume: Tensor = -torch.linalg.slogdet(columns).logabsdet
    return volume
