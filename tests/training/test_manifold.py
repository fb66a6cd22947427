"""Training pose manifolds: objectives against their formulas, health, stages that resume, and what q and -q come to."""

import math
import os
import signal
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation
from torch.testing import assert_close

from geomotion import manifold_models
from geomotion.config import Antipodal, JCDataset, ManifoldConfig, ManifoldTraining
from geomotion.demos.generators import jc
from geomotion.demos.poses import pose_paths
from geomotion.errors import DatasetError, Interrupted
from geomotion.networks.pose_vae import DecodedPose, PoseVAE
from geomotion.networks.von_mises_fisher import antipodal_log_density, log_density
from geomotion.scores.paths import PosePath
from geomotion.training.kinds import Poses
from geomotion.training.manifold import Health, PoseReconstruction, SpreadLikelihood, judge
from geomotion.training.manifold_fit import FittedManifold, fit_manifold
from geomotion.training.poses import PoseSpace, both_signs
from geomotion.training.states import TrainingSet

SETTINGS = ManifoldTraining(
    steps=30, batch_points=16, spread_steps=20, restarts=0, checkpoint_every_steps=7, log_every_steps=5, ramp_steps=5
)
CONFIG = ManifoldConfig(latent_dim=2, hidden_units=[8], kernels=6, mixed_copies=1, points=20)


def paths(demos: int = 3, points: int = 20) -> list[PosePath]:
    """Arcs side by side, turning on the way."""
    done, found = np.linspace(0, 1, points), []
    for offset in np.linspace(-0.1, 0.1, demos):
        position = np.stack([np.cos(3 * done), np.sin(3 * done) + offset, done], axis=1)
        turns = Rotation.from_rotvec(np.stack([0 * done, offset + 0 * done, 2 * done], axis=1))
        found.append(PosePath(position, turns.as_quat(scalar_first=True)))
    return found


def data() -> TrainingSet:
    return TrainingSet.of(PoseSpace.of(paths()), paths(), [""] * 3, carry=False)


def network(seed: int = 0, config: ManifoldConfig = CONFIG) -> PoseVAE:
    model = manifold_models.build(config, data().space, seed)
    generator = torch.Generator().manual_seed(0)
    model.precision.place(torch.randn(config.kernels, 2, generator=generator), 1.0, 20.0)
    model.concentration.place(torch.randn(config.kernels, 2, generator=generator), 1.0, 500.0)
    return model


def ignore(step: int, values: object) -> None:
    """Log nothing."""


# ---------------------------------------------------------------- objectives
@pytest.mark.parametrize("antipodal", list(Antipodal))
def test_means_are_fitted_by_the_weighted_evidence_bound(antipodal):
    poses, progress = data().tensors(0, 0)
    settings = replace(SETTINGS, position_weight=2.0, orientation_weight=3.0, divergence_weight=0.5, warm_up=0.5)
    model = network()
    losses = PoseReconstruction(poses, progress, settings, antipodal)(model, 0.25, torch.Generator().manual_seed(4))
    generator = torch.Generator().manual_seed(4)
    chosen = torch.randint(len(poses), (16,), generator=generator)
    x, s = poses[chosen], progress[chosen]
    mean, log_variance = model.encode(x, s)
    posterior = torch.distributions.Normal(mean, (log_variance / 2).exp())
    decoded = model.decode(mean + torch.randn(16, 2, generator=generator) * posterior.stddev)
    gaussian = torch.distributions.Normal(decoded.position, settings.fixed_std)
    constant = 3 * (math.log(settings.fixed_std) + math.log(2 * math.pi) / 2)
    density = antipodal_log_density if antipodal is Antipodal.mixture else log_density
    kappa = torch.full((16,), settings.fixed_concentration)
    prior = torch.distributions.Normal(torch.zeros(2), torch.ones(2))
    expected = {
        "position": -2 * (gaussian.log_prob(x[:, :3]).sum(dim=-1) + constant).mean(),  # (3.7)
        "orientation": -3 * density(x[:, 3:], decoded.orientation, kappa).mean(),  # (3.8)
        "progress": (decoded.progress - s).square().mean() / (2 * settings.progress_std**2),
        "divergence": 0.5 * 0.5 * torch.distributions.kl_divergence(posterior, prior).sum(dim=-1).mean(),
    }
    assert_close(dict(losses), expected, rtol=1e-4, atol=1e-4)


def test_without_warm_up_the_divergence_counts_from_the_start():
    poses, progress = data().tensors(0, 0)
    values = []
    for settings, share in ((replace(SETTINGS, warm_up=0.0), 0.0), (SETTINGS, 0.9), (SETTINGS, 0.0)):
        objective = PoseReconstruction(poses, progress, settings, Antipodal.aligned)
        values.append(float(objective(network(), share, torch.Generator().manual_seed(0))["divergence"].detach()))
    assert values[0] == values[1] > 0 == values[2]


def test_one_step_of_the_means_has_the_recorded_losses():
    poses, progress = both_signs(*data().tensors(1, 0), position_dim=3)
    losses = PoseReconstruction(poses, progress, SETTINGS, Antipodal.doubled)(
        network(), 1.0, torch.Generator().manual_seed(0)
    )
    found = {name: float(loss.detach()) for name, loss in losses.items()}
    expected = {"position": 956.06, "orientation": 1047.17, "progress": 370.33, "divergence": 0.031227}
    assert found == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("antipodal", list(Antipodal))
def test_spreads_are_fitted_by_their_likelihood_and_leave_the_means_alone(antipodal):
    poses, progress = Poses(data(), PoseSpace.of(paths()), antipodal).samples(0, 0)
    assert len(poses) == 60 * (1 if antipodal is Antipodal.aligned else 2)
    model = network()
    losses = SpreadLikelihood(poses, progress, 16, antipodal)(model, 0.0, torch.Generator().manual_seed(4))
    generator = torch.Generator().manual_seed(4)
    chosen = torch.randint(len(poses), (16,), generator=generator)
    mean, log_variance = model.encode(poses[chosen], progress[chosen])
    z = (mean + torch.randn(16, 2, generator=generator) * (log_variance / 2).exp()).detach()
    decoded = model.decode(z)
    gaussian = torch.distributions.Normal(decoded.position, model.std(z)[:, None])  # (3.2)
    density = antipodal_log_density if antipodal is Antipodal.mixture else log_density
    expected = {
        "std": -(gaussian.log_prob(poses[chosen, :3]).sum(dim=-1) + 3 * math.log(2 * math.pi) / 2).mean(),
        "concentration": -density(poses[chosen, 3:], decoded.orientation, model.concentration(z)).mean(),
    }
    assert_close(dict(losses), expected, rtol=1e-4, atol=1e-4)
    (losses["std"] + losses["concentration"]).backward()
    for name, parameter in model.named_parameters():
        is_spread = name.startswith(("precision", "concentration"))
        assert (parameter.grad is not None and parameter.grad.abs().max() > 0) == is_spread


# ---------------------------------------------------------------- health
class Oracle(PoseVAE):
    """Encodes a pose by a function of its progress and place, and decodes it exactly, or not at all."""

    def __init__(
        self, poses: torch.Tensor, progress: torch.Tensor, codes: torch.Tensor, collapsed: bool = False
    ) -> None:
        super().__init__(3, 4, 2, [4], 5, 100.0, 1e-4)
        self.known = (poses, progress, codes, collapsed)

    def encode(self, pose, progress):
        poses, known_progress, codes, _ = self.known
        places = [torch.cat([x[:, :3], s[:, None]], dim=1) for x, s in ((pose, progress), (poses, known_progress))]
        found = codes[torch.cdist(*places, compute_mode="donot_use_mm_for_euclid_dist").argmin(dim=1)]
        return found, torch.zeros_like(found)

    def decode(self, z):
        poses, progress, codes, collapsed = self.known
        found = torch.cdist(z, codes, compute_mode="donot_use_mm_for_euclid_dist").argmin(dim=1)
        shown = poses.mean(dim=0).expand(len(z), 7) if collapsed else poses[found]
        return DecodedPose(shown[:, :3], shown[:, 3:], progress[found])


def health(codes: torch.Tensor, collapsed: bool = False, sign: float = 1.0, antipodal=Antipodal.aligned) -> Health:
    poses, progress = data().tensors(0, 0)
    shown = torch.cat([poses[:, :3], sign * poses[:, 3:]], dim=1)
    model = Oracle(shown, progress, codes, collapsed)
    return judge(model, poses, progress, 0.05, Poses(data(), PoseSpace.of(paths()), antipodal).orientation_at)


def tube(folded: bool) -> torch.Tensor:
    """Codes of the demonstrations, along a line; folded, the way back lies on the way there."""
    _, progress = data().tensors(0, 0)
    along = (0.5 - (progress - 0.5).abs()) * 2 if folded else progress
    beside = torch.arange(3).repeat_interleave(20) * 0.05 + 0.02 * (progress > 0.5)
    return torch.stack([4 * along, beside], dim=1)


def test_a_latent_space_like_the_demonstrations_is_good():
    found = health(tube(folded=False))
    assert found.is_good and found.unexplained < 1e-6 and found.folded == 0


def test_a_collapsed_latent_space_is_not_good():
    found = health(tube(folded=False), collapsed=True)
    assert not found.is_good and found.unexplained == pytest.approx(1, abs=1e-3)


def test_a_folded_latent_space_is_not_good():
    found = health(tube(folded=True))
    assert not found.is_good and found.folded > 0.3 and found.unexplained < 1e-6
    assert found.score < health(tube(folded=False)).score


def test_only_the_mixture_may_decode_the_other_sign():
    assert health(tube(folded=False), sign=-1.0, antipodal=Antipodal.mixture).unexplained < 1e-6
    assert health(tube(folded=False), sign=-1.0).unexplained > 0.5


def test_very_many_poses_are_judged_by_an_even_selection(monkeypatch):
    whole = health(tube(folded=True))
    monkeypatch.setattr("geomotion.training.manifold.MOST_JUDGED", 20)
    some = health(tube(folded=True))
    assert some.folded == pytest.approx(whole.folded, abs=0.15) and some.unexplained == whole.unexplained


# ---------------------------------------------------------------- stages
def train(
    checkpoint: Path, log=ignore, seed: int = 0, training: ManifoldTraining = SETTINGS, **changes
) -> FittedManifold:
    config = replace(CONFIG, **changes)
    build = partial(manifold_models.build, config, data().space)
    return fit_manifold(data(), config, training, build, seed, checkpoint, log)


def test_training_lowers_both_losses_and_logs_them_one_after_the_other(tmp_path):
    logged: dict[int, dict[str, float]] = {}
    training = replace(SETTINGS, steps=150, spread_steps=60)
    fitted = train(tmp_path / "checkpoint", logged.__setitem__, training=training)
    means, spreads = (history.rows for history in fitted.histories)
    assert means[-1]["total"] < 0.5 * means[0]["total"]
    assert spreads[-1]["std"] < spreads[0]["std"]
    assert "position" in logged[149] and "spread.std" in logged[150] and max(logged) == 209
    assert all(parameter.requires_grad for parameter in fitted.network.parameters())


def test_kernels_lie_among_the_codes(tmp_path):
    fitted = train(tmp_path / "checkpoint")
    poses, progress = data().tensors(1, 0)
    codes = fitted.network.encode(poses, progress)[0].detach()
    centres = fitted.network.precision.centres
    assert torch.equal(centres, fitted.network.concentration.centres)
    assert (centres.amin(dim=0) >= codes.amin(dim=0)).all() and (centres.amax(dim=0) <= codes.amax(dim=0)).all()
    spacing = torch.cdist(centres, centres).fill_diagonal_(torch.inf).amin(dim=1).median()
    widths = [float(part.bandwidth) for part in (fitted.network.precision, fitted.network.concentration)]
    assert widths[0] == widths[1] > 0.5 * CONFIG.bandwidth * float(spacing)


@pytest.mark.parametrize("stopped_at", [(0, 10), (30, 5)], ids=["means", "spreads"])
def test_an_interrupted_training_ends_in_the_same_parameters(tmp_path, stopped_at):
    phase, step = stopped_at
    whole = train(tmp_path / "whole")

    def stop(at: int, values: object) -> None:
        if at == phase + step:
            os.kill(os.getpid(), signal.SIGTERM)

    with pytest.raises(Interrupted):
        train(tmp_path / "resumed", stop)
    resumed = train(tmp_path / "resumed")
    for (name, one), other in zip(
        whole.network.state_dict().items(), resumed.network.state_dict().values(), strict=True
    ):
        assert torch.equal(one, other), name
    assert [history.rows for history in resumed.histories] == [history.rows for history in whole.histories]
    assert not list(tmp_path.glob("*.means*"))


def test_the_seed_decides(tmp_path):
    one, again, other = (train(tmp_path / name, seed=seed) for name, seed in (("a", 0), ("b", 0), ("c", 1)))
    weights = [fitted.network.decoder[0].weight for fitted in (one, again, other)]
    assert torch.equal(weights[0], weights[1]) and not torch.equal(weights[0], weights[2])


def test_a_bad_latent_space_is_tried_again_and_the_best_is_kept(tmp_path, caplog):
    training = replace(SETTINGS, restarts=2)
    fitted = train(tmp_path / "checkpoint", training=training, mixed_copies=0)
    assert fitted.attempts == 3 and not fitted.health.is_good
    assert sum("is not good" in message for message in caplog.messages) == 3
    alone = [train(tmp_path / f"{seed}", seed=7919 * seed, mixed_copies=0).health.score for seed in range(3)]
    assert fitted.health.score == pytest.approx(max(alone))
    assert not list(tmp_path.glob("*.means*"))


def test_fewer_poses_than_kernels_are_refused(tmp_path):
    with pytest.raises(DatasetError, match=r"120 points to train on, fewer than manifold\.kernels=500; lower it"):
        train(tmp_path / "checkpoint", kernels=500)


# ---------------------------------------------------------------- q and -q
def gap_in_spacings(antipodal: Antipodal, checkpoint: Path) -> float:
    """Latent distance from the codes of -q to the nearest of q, in median steps between neighbouring poses."""
    demonstrations = pose_paths(jc.generate(JCDataset(demos=4, points=100)), 60)
    data = TrainingSet.of(PoseSpace.of(demonstrations), demonstrations, [""] * 4, carry=False)
    config = ManifoldConfig(latent_dim=2, hidden_units=[40, 30], kernels=40, mixed_copies=0, antipodal=antipodal)
    training = ManifoldTraining(
        steps=450, learning_rate=5e-3, batch_points=128, spread_steps=1, restarts=0, divergence_weight=0.01
    )
    build = partial(manifold_models.build, config, data.space)
    model = fit_manifold(data, config, training, build, 0, checkpoint, ignore).network
    poses, progress = both_signs(*data.tensors(0, 0), position_dim=demonstrations[0].position_m.shape[1])
    with torch.no_grad():
        codes, others = model.encode(poses, progress)[0].chunk(2)
    spacing = codes[:60].diff(dim=0).norm(dim=1).median()
    return float(torch.cdist(others, codes).amin(dim=1).median() / spacing)


def test_the_plain_density_keeps_both_signs_apart_and_the_mixture_merges_them(tmp_path):
    assert gap_in_spacings(Antipodal.doubled, tmp_path / "doubled") > 5
    assert gap_in_spacings(Antipodal.mixture, tmp_path / "mixture") < 1
