"""The auto-encoder of poses: unit orientations, and coordinates whose metric is that of (3.10)-(3.13)."""

import math

import pytest
import torch
from torch.func import jacrev, vmap
from torch.testing import assert_close

from geomotion.networks.pose_vae import LOG_VARIANCE_RANGE, PoseVAE


def network(position_dim: int = 3, orientation_dim: int = 4, latent_dim: int = 2) -> PoseVAE:
    torch.manual_seed(0)
    model = PoseVAE(position_dim, orientation_dim, latent_dim, (12, 9), 15, 100.0, 1e-4).double()
    centres = torch.randn(15, latent_dim, dtype=torch.float64)
    model.precision.place(centres, 0.7, 30.0)
    model.concentration.place(centres, 0.7, 1000.0)
    return model


def latent(count: int, dim: int = 2) -> torch.Tensor:
    return torch.randn(count, dim, dtype=torch.float64, generator=torch.Generator().manual_seed(1))


@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
@pytest.mark.parametrize(("position_dim", "orientation_dim", "latent_dim"), [(3, 4, 2), (2, 3, 2), (3, 4, 3)])
def test_shapes_follow_the_dimensions_for_any_batch(position_dim, orientation_dim, latent_dim, batch):
    model = network(position_dim, orientation_dim, latent_dim)
    pose, progress = torch.randn(*batch, position_dim + orientation_dim).double(), torch.rand(batch).double()
    mean, log_variance = model.encode(pose, progress)
    assert mean.shape == log_variance.shape == (*batch, latent_dim)
    decoded = model.decode(mean)
    assert decoded.position.shape == (*batch, position_dim)
    assert decoded.progress.shape == batch
    assert model.embed_position(mean).shape == (*batch, position_dim + 1)
    assert model.embed_orientation(mean).shape == (*batch, orientation_dim + 1)
    assert_close(decoded.orientation.norm(dim=-1), torch.ones(batch).double())


def test_hidden_layers_of_the_decoder_are_those_of_the_encoder_in_reverse():
    model = network()
    widths = [[len(layer.weight) for layer in list(part)[::2]] for part in (model.encoder, model.decoder)]
    assert widths == [[12, 9, 4], [9, 12, 8]]


def test_the_posterior_depends_on_progress_and_its_variance_stays_in_a_range():
    model, pose = network(), 1e4 * torch.randn(50, 7).double()
    _, log_variance = model.encode(pose, torch.zeros(50).double())
    assert log_variance.min() >= LOG_VARIANCE_RANGE[0] and log_variance.max() <= LOG_VARIANCE_RANGE[1]
    other, _ = model.encode(1e-4 * pose, torch.ones(50).double())
    still, _ = model.encode(1e-4 * pose, torch.zeros(50).double())
    assert (other - still).abs().max() > 1e-3


def test_far_from_the_data_spreads_are_the_largest():
    model = network().requires_grad_(False)
    far = torch.full((2,), 1e3).double()
    assert float(model.std(far)) == pytest.approx(100.0)
    assert float(model.embed_orientation(far)[-1]) == pytest.approx(math.sqrt(3 / 1e-4))
    assert float(model.embed_orientation(far, raw=True)[-1]) == pytest.approx(2 * 1e-4)


@pytest.mark.parametrize("raw", [False, True])
def test_embeddings_pull_back_the_sums_of_the_thesis(raw):
    model, z = network(), latent(6)

    def metric(function) -> torch.Tensor:
        jacobian = vmap(jacrev(function))(z)
        return jacobian.mT @ jacobian

    def deviations(z):
        return model.std(z)[..., None].expand(*z.shape[:-1], 3)  # σ of each coordinate, (3.2)

    def concentrations(z):
        return model.concentration(z)[..., None].expand(*z.shape[:-1], 4)

    of_position = metric(lambda z: model.decode(z).position) + metric(deviations)  # (3.10), (3.11)
    assert_close(metric(model.embed_position), of_position)
    spread = concentrations if raw else lambda z: (3 / model.concentration(z)).sqrt()[..., None]
    of_orientation = metric(lambda z: model.decode(z).orientation) + metric(spread)  # (3.12), (3.13)
    assert_close(metric(lambda z: model.embed_orientation(z, raw)), of_orientation)


def test_the_spread_of_orientations_is_their_root_mean_square_angle():
    concentration = 400.0
    angle = torch.linspace(0, math.pi, 20_001).double()
    weight = angle.sin().square() * (concentration * (angle.cos() - 1)).exp()  # (3.3) on S³
    exact = (angle.square() * weight).sum() / weight.sum()
    assert math.sqrt(3 / concentration) == pytest.approx(float(exact.sqrt()), rel=2e-3)
