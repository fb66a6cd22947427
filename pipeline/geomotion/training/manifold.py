"""Objectives of a pose manifold: first the means, then how far they are off."""

from collections.abc import Mapping
from dataclasses import dataclass

import torch

from geomotion.config import Antipodal, ManifoldTraining
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
        z = mean + torch.randn(mean.shape, generator=generator) * (log_variance / 2).exp()
        decoded = model.decode(z)
        position, orientation = torch.split(poses, [model.position_dim, model.orientation_dim], dim=-1)
        density = antipodal_log_density if self.antipodal is Antipodal.mixture else log_density
        concentration = torch.full_like(done, settings.fixed_concentration)
        fit_x = (decoded.position - position).square().sum(dim=-1) / (2 * settings.fixed_std**2)
        fit_q = -density(orientation, decoded.orientation, concentration)
        fit_s = (decoded.progress - done).square() / (2 * settings.progress_std**2)
        divergence = (mean.square() + log_variance.exp() - log_variance - 1).sum(dim=-1) / 2
        ramp = min(1.0, progress / settings.warm_up) if settings.warm_up > 0 else 1.0
        return {
            "position": settings.position_weight * fit_x.mean(),
            "orientation": settings.orientation_weight * fit_q.mean(),
            "progress": fit_s.mean(),
            "divergence": settings.divergence_weight * ramp * divergence.mean(),
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
            z = mean + torch.randn(mean.shape, generator=generator) * (log_variance / 2).exp()
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
class Health:
    """Whether a latent space can carry geodesics.

    Attributes:
        unexplained: Share of the variance of poses that the means miss; near 1 where the latent space collapsed.
        folded: Share of encoded poses whose nearest latent neighbour from another part of the motion is nearer than
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
MOST_JUDGED = 4000  # poses, each of which is compared with all others
FAR_APART = 0.5  # distance of such poses, in units of the data's scale


def judge(
    model: PoseVAE,
    poses: Float[Tensor, "point D"],
    progress: Float[Tensor, " point"],
    nearby: float,
    antipodal: Antipodal = Antipodal.aligned,
) -> Health:
    """Judge encoded poses; of very many, an even selection is looked at for folds.

    Args:
        model: With trained means.
        poses: Demonstrated poses, without mixtures.
        progress: Their progress.
        nearby: Latent distance between neighbouring demonstrations.
        antipodal: With the mixture, decoded orientations have either sign.
    """
    some = slice(None, None, -(-len(poses) // MOST_JUDGED))
    with torch.no_grad():
        codes, _ = model.encode(poses, progress)
        decoded = model.decode(codes)
        found, wanted = decoded.orientation, poses[:, model.position_dim :]
        if antipodal is Antipodal.mixture:
            found = torch.where((found * wanted).sum(dim=-1, keepdim=True) < 0, -found, found)
        missed = torch.cat([decoded.position, found], dim=-1) - poses
        unexplained = missed.square().sum() / (poses - poses.mean(dim=0)).square().sum()
        other = (progress[some, None] - progress).abs() > OTHER_PART
        other &= torch.cdist(poses[some], poses) > FAR_APART
        gaps = torch.where(other, torch.cdist(codes[some], codes), torch.inf).amin(dim=1)
    return Health(float(unexplained), float((gaps < nearby).float().mean()))
