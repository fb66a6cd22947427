"""The auto-encoder behind a decoder, and the codes that a field is learned on."""

import pytest
import torch
from torch.testing import assert_close

from geomotion import config as schema
from geomotion import models
from geomotion.dynamics.injective import DecoderChart
from geomotion.networks.injective_vae import InjectiveVAE
from geomotion.training.data import Geometry, TrainingSet
from geomotion.training.injective_vae import StateReconstruction, encoded, fit_decoder

CHART = schema.InjectiveVaeChart(latent_dim=1, units=8)
SETTINGS = schema.VaeTraining(steps=60, batch_points=64, ramp_steps=5)


@pytest.fixture(scope="module")
def data() -> TrainingSet:
    """Arcs of circles of nearly one radius, in a plane of space."""
    times = torch.linspace(0, 2, 80)
    angle = 1.5 * (1 - times / 2) ** 2
    states = [r * torch.stack([angle.cos(), angle.sin(), 0.5 * angle.sin()], dim=-1) for r in (0.1, 0.102, 0.098)]
    return TrainingSet((times,) * 3, tuple(states), tuple(torch.zeros_like(one) for one in states))


def new_decoder(data: TrainingSet) -> DecoderChart:
    return models.build_decoder(CHART, Geometry.of(data), seed=0)


@pytest.fixture(scope="module")
def trained(data, tmp_path_factory):
    decoder, checkpoint = new_decoder(data), tmp_path_factory.mktemp("vae") / "checkpoint"
    scale_m = Geometry.of(data).scale_m
    history = fit_decoder(decoder, data, scale_m, SETTINGS, 0, checkpoint, lambda step, values: None)
    return decoder, history


def test_states_are_scaled_into_the_range_of_the_splines(data):
    decoder = new_decoder(data)
    scaled = decoder.scaling.to_latent(data.all_states)
    assert float(scaled.abs().max()) == pytest.approx(CHART.filled * CHART.bound, rel=1e-5)


def test_the_bound_improves_and_states_are_reconstructed(data, trained):
    decoder, history = trained
    assert history.rows[-1]["total"] < 0.1 * history.rows[0]["total"]

    def missed(one: DecoderChart) -> float:
        return float((one.project(data.all_states) - data.all_states).norm(dim=-1).mean().detach())

    assert missed(decoder) < 0.25 * missed(new_decoder(data))


def test_the_decoder_is_frozen(trained):
    assert not any(parameter.requires_grad for parameter in trained[0].parameters())


def test_the_loss_is_the_negative_evidence_lower_bound(data):
    """Against torch's own normal distributions; constants of the likelihood are left out."""
    model = InjectiveVAE(new_decoder(data), units=8)
    objective = StateReconstruction(data.all_states, 0.01, SETTINGS)
    losses = objective(model, 0.0, torch.Generator().manual_seed(3))
    generator = torch.Generator().manual_seed(3)
    x = data.all_states[torch.randint(len(data.all_states), (SETTINGS.batch_points,), generator=generator)]
    mean, log_variance = model.encode(x)
    posterior = torch.distributions.Normal(mean, (log_variance / 2).exp())
    z = mean + posterior.stddev * torch.randn(mean.shape, generator=generator)
    likelihood = torch.distributions.Normal(model.decode(z), 0.01)
    constant = likelihood.log_prob(likelihood.mean).sum(-1)
    assert_close(losses["reconstruction"], -(likelihood.log_prob(x).sum(-1) - constant).mean())
    prior = torch.distributions.Normal(torch.zeros(1), torch.ones(1))
    assert_close(losses["divergence"], torch.distributions.kl_divergence(posterior, prior).sum(-1).mean())


def test_velocities_of_codes_are_derivatives_of_codes(data, trained):
    decoder, _ = trained
    codes = encoded(data, decoder)
    for code, velocity, times in zip(codes.states, codes.velocities, codes.times, strict=True):
        assert code.shape == velocity.shape == (len(times), 1)
        assert_close(velocity[1:-1], (code[2:] - code[:-2]) / (times[2:] - times[:-2])[:, None], rtol=1e-3, atol=1e-3)
