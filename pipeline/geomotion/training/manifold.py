"""Objectives of a manifold of poses or of configurations: first the means, then how far they are off."""

from collections.abc import Mapping
from dataclasses import dataclass

import torch

from geomotion.config import Antipodal, ManifoldTraining
from geomotion.networks.joint_vae import JointVAE
from geomotion.networks.pose_vae import PoseVAE
from geomotion.networks.von_mises_fisher import antipodal_log_density, log_density
from geomotion.types import Float, Tensor


@dataclass(frozen=True)
class PoseReconstruction:
    """The evidence lower bound with fixed spreads, on random batches.

    Attributes:
        poses: Scaled positions and unit orientations, shape (point, D).
        progress: Their progress.
        settings: Weights and spreads.
        antipodal: Which density orientations have.

    Source: Thesis Eq. (3.6)-(3.8).
    """

    poses: Float[Tensor, "point D"]
    progress: Float[Tensor, " point"]
    settings: ManifoldTraining
    antipodal: Antipodal

    def __call__(self, model: PoseVAE, progress: float, generator: torch.Generator) -> Mapping[str, Tensor]:
        settings = self.settings
        chosen = torch.randint(len(self.poses), (settings.batch_points,), generator=generator)
        poses, done = self.poses[chosen], self.progress[chosen]
        mean, log_variance = model.encode(poses, done)
        z = drawn(mean, log_variance, generator)
        decoded = model.decode(z)
        position, orientation = torch.split(poses, [model.position_dim, model.orientation_dim], dim=-1)
        density = antipodal_log_density if self.antipodal is Antipodal.mixture else log_density
        concentration = torch.full_like(done, settings.fixed_concentration)
        fit_x = _squares(decoded.position - position, settings.fixed_std)
        fit_q = -density(orientation, decoded.orientation, concentration)
        fit_s = _squares((decoded.progress - done)[:, None], settings.progress_std)
        return {
            "position": settings.position_weight * fit_x.mean(),
            "orientation": settings.orientation_weight * fit_q.mean(),
            "progress": fit_s.mean(),
            "divergence": settings.divergence_at(progress) * divergence(mean, log_variance).mean(),
        }


@dataclass(frozen=True)
class SpreadLikelihood:
    """Likelihood of the spreads σ and κ alone, the means being fixed.

    Attributes:
        poses: As in :class:`PoseReconstruction`.
        progress: Their progress.
        batch_points: Poses of each step.
        antipodal: Which density orientations have.

    Source: Thesis Eq. (3.2), (3.3), (3.5), Sec. 3.5.5.
    """

    poses: Float[Tensor, "point D"]
    progress: Float[Tensor, " point"]
    batch_points: int
    antipodal: Antipodal

    def __call__(self, model: PoseVAE, progress: float, generator: torch.Generator) -> Mapping[str, Tensor]:
        chosen = torch.randint(len(self.poses), (self.batch_points,), generator=generator)
        poses = self.poses[chosen]
        with torch.no_grad():
            mean, log_variance = model.encode(poses, self.progress[chosen])
            z = drawn(mean, log_variance, generator)
            decoded = model.decode(z)
        position, orientation = torch.split(poses, [model.position_dim, model.orientation_dim], dim=-1)
        precision = model.precision(z)
        squares = (decoded.position - position).square().sum(dim=-1)
        density = antipodal_log_density if self.antipodal is Antipodal.mixture else log_density
        return {
            "std": (squares * precision.square() / 2 - model.position_dim * precision.log()).mean(),
            "concentration": -density(orientation, decoded.orientation, model.concentration(z)).mean(),
        }


@dataclass(frozen=True)
class JointReconstruction:
    """The evidence lower bound of configurations with a fixed spread, on random batches.

    Attributes:
        joints: Scaled configurations, shape (point, joint).
        progress: Their progress.
        settings: Weights and spreads.

    Source: Thesis Eq. (4.1), (4.2), Sec. 4.3.2.
    """

    joints: Float[Tensor, "point joint"]
    progress: Float[Tensor, " point"]
    settings: ManifoldTraining

    def __call__(self, model: JointVAE, progress: float, generator: torch.Generator) -> Mapping[str, Tensor]:
        settings = self.settings
        chosen = torch.randint(len(self.joints), (settings.batch_points,), generator=generator)
        joints, done = self.joints[chosen], self.progress[chosen]
        mean, log_variance = model.encode(joints, done)
        z = drawn(mean, log_variance, generator)
        decoded, decoded_progress = model.reconstruct(z)
        losses = {
            "joints": settings.position_weight * _squares(decoded - joints, settings.fixed_std).mean(),
            "progress": _squares((decoded_progress - done)[:, None], settings.progress_std).mean(),
            "divergence": settings.divergence_at(progress) * divergence(mean, log_variance).mean(),
        }
        if settings.volume_weight > 0:
            some = model.joints_rad(z[: settings.volume_points])
            volume = model.kinematics.log_volume(some, settings.volume_regularisation)
            losses["volume"] = settings.volume_weight * volume.mean()
        return losses


@dataclass(frozen=True)
class JointSpreadLikelihood:
    """Likelihood of the spread σ of configurations alone, the means being fixed.

    Attributes:
        joints: As in :class:`JointReconstruction`.
        progress: Their progress.
        batch_points: Configurations of each step.

    Source: Thesis Eq. (4.1), Sec. 4.3.2.
    """

    joints: Float[Tensor, "point joint"]
    progress: Float[Tensor, " point"]
    batch_points: int

    def __call__(self, model: JointVAE, progress: float, generator: torch.Generator) -> Mapping[str, Tensor]:
        chosen = torch.randint(len(self.joints), (self.batch_points,), generator=generator)
        joints = self.joints[chosen]
        with torch.no_grad():
            mean, log_variance = model.encode(joints, self.progress[chosen])
            z = drawn(mean, log_variance, generator)
            squares = (model.reconstruct(z)[0] - joints).square().sum(dim=-1)
        precision = model.precision(z)
        return {"std": (squares * precision.square() / 2 - joints.shape[-1] * precision.log()).mean()}


def _squares(missed: Float[Tensor, "point D"], std: float) -> Float[Tensor, " point"]:
    return missed.square().sum(dim=-1) / (2 * std**2)


def drawn(
    mean: Float[Tensor, "point d"], log_variance: Float[Tensor, "point d"], generator: torch.Generator
) -> Float[Tensor, "point d"]:
    """From the posterior."""
    return mean + torch.randn(mean.shape, generator=generator) * (log_variance / 2).exp()


def divergence(mean: Float[Tensor, "point d"], log_variance: Float[Tensor, "point d"]) -> Float[Tensor, " point"]:
    """Of the posterior from the prior."""
    return (mean.square() + log_variance.exp() - log_variance - 1).sum(dim=-1) / 2


@dataclass(frozen=True)
class Health:
    """Whether a latent space can carry geodesics.

    Attributes:
        unexplained: Share of the variance of states that the means miss; near 1 where the latent space collapsed.
        folded: Share of encoded states whose nearest latent neighbour from another part of the motion is nearer than
            neighbouring demonstrations are: there the space is folded onto itself.
    """

    unexplained: float
    folded: float

    @property
    def is_good(self) -> bool:
        """Whether no other start of the training should be tried."""
        return self.unexplained < LARGEST_UNEXPLAINED and self.folded < LARGEST_FOLDED

    @property
    def score(self) -> float:
        """The larger, the better."""
        return -self.unexplained / LARGEST_UNEXPLAINED - self.folded / LARGEST_FOLDED


LARGEST_UNEXPLAINED = 0.05
LARGEST_FOLDED = 0.05
OTHER_PART = 0.25  # difference in progress that makes another part of the motion
MOST_JUDGED = 4000  # states, each of which is compared with all others
FAR_APART = 0.5  # distance of such states, in units of the data's scale


def judge(
    model: PoseVAE | JointVAE,
    states: Float[Tensor, "point D"],
    progress: Float[Tensor, " point"],
    nearby: float,
    orientation_at: int | None = None,
) -> Health:
    """Judge encoded states; of very many, an even selection is looked at for folds.

    Args:
        model: With trained means.
        states: Demonstrated states, scaled, without mixtures.
        progress: Their progress.
        nearby: Latent distance between neighbouring demonstrations.
        orientation_at: Where orientations begin in a state, if decoded ones have either sign.
    """
    some = slice(None, None, -(-len(states) // MOST_JUDGED))
    with torch.no_grad():
        codes, _ = model.encode(states, progress)
        found, _ = model.reconstruct(codes)
        if orientation_at is not None:
            turned = found[:, orientation_at:]
            is_other = (turned * states[:, orientation_at:]).sum(dim=-1, keepdim=True) < 0
            found = torch.cat([found[:, :orientation_at], torch.where(is_other, -turned, turned)], dim=-1)
        unexplained = (found - states).square().sum() / (states - states.mean(dim=0)).square().sum()
        other = (progress[some, None] - progress).abs() > OTHER_PART
        other &= torch.cdist(states[some], states) > FAR_APART
        gaps = torch.where(other, torch.cdist(codes[some], codes), torch.inf).amin(dim=1)
    return Health(float(unexplained), float((gaps < nearby).float().mean()))
