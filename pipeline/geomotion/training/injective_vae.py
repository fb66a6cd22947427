"""A decoder of states and the codes of demonstrations, on which a field is then learned.

Source: Thesis Algorithm 1.
"""

from dataclasses import dataclass
from pathlib import Path

import torch

from geomotion.config import VaeTraining
from geomotion.demos.preprocessing import estimate_velocity
from geomotion.dynamics.injective import DecoderChart
from geomotion.networks.injective_vae import InjectiveVAE
from geomotion.training.data import TrainingSet
from geomotion.training.manifold import divergence, drawn
from geomotion.training.trainer import History, Log, Losses, Schedule, fit
from geomotion.types import States

SPREAD_UNITS = 50  # of the network of the posterior's spread, which the thesis leaves open


@dataclass(frozen=True)
class StateReconstruction:
    """The negative evidence lower bound up to a constant, on random batches.

    Attributes:
        states: Demonstrated states [m].
        decoder_std: σ of each decoded coordinate [m].
        settings: Batch size, and the weight of the divergence.

    Source: Thesis Eq. (2.8), with the posterior of Sec. 6.1.
    """

    states: States
    decoder_std: float
    settings: VaeTraining

    def __call__(self, model: InjectiveVAE, progress: float, generator: torch.Generator) -> Losses:
        chosen = torch.randint(len(self.states), (self.settings.batch_points,), generator=generator)
        states = self.states[chosen]
        mean, log_variance = model.encode(states)
        missed = (model.decode(drawn(mean, log_variance, generator)) - states) / self.decoder_std
        return {
            "reconstruction": missed.square().sum(dim=-1).mean() / 2,
            "divergence": self.settings.divergence_weight * divergence(mean, log_variance).mean(),
        }


def fit_decoder(
    decoder: DecoderChart,
    data: TrainingSet,
    scale_m: float,
    settings: VaeTraining,
    seed: int,
    checkpoint: Path,
    log: Log,
) -> History:
    """Train a decoder in place and freeze it.

    Args:
        decoder: Untrained.
        data: States to be encoded.
        scale_m: Half the longest side of the box around them [m].
        settings: Weights and schedule.
        seed: Of the optimisation.
        checkpoint: Where progress is kept.
        log: Takes losses.

    Raises:
        TrainingDiverged: If it breaks down again and again.
        Interrupted: If a signal arrived.
    """
    objective = StateReconstruction(data.all_states, settings.decoder_std * scale_m, settings)
    schedule = Schedule(
        settings.steps, settings.learning_rate, settings.ramp_steps, settings.gradient_clip,
        settings.checkpoint_every_steps, settings.log_every_steps, seed,
    )  # fmt: skip
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        model = InjectiveVAE(decoder, SPREAD_UNITS)
    history = fit(model, objective, schedule, checkpoint, log)
    decoder.requires_grad_(False)
    return history


@torch.no_grad()
def encoded(data: TrainingSet, decoder: DecoderChart) -> TrainingSet:
    """Codes of demonstrations, and velocities differentiated along each of them.

    Source: Thesis Algorithm 1, lines 8-13; differences of second order in place of its forward ones.
    """
    codes = [decoder.to_latent(states) for states in data.states]
    velocities = [
        torch.as_tensor(estimate_velocity(times.double().numpy(), code.double().numpy()), dtype=code.dtype)
        for times, code in zip(data.times, codes, strict=True)
    ]
    return TrainingSet(data.times, tuple(codes), tuple(velocities))
