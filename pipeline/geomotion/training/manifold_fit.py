"""Training a pose manifold in stages: means, kernels, spreads; from another seed where the latent space is bad."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from scipy.cluster.vq import kmeans2
from scipy.spatial import cKDTree

from geomotion.config import Antipodal, ManifoldConfig, ManifoldTraining
from geomotion.errors import DatasetError
from geomotion.manifolds.density import mean_distance_between
from geomotion.networks.pose_vae import PoseVAE
from geomotion.training.manifold import Health, PoseReconstruction, SpreadLikelihood, judge
from geomotion.training.poses import PoseTrainingSet
from geomotion.training.trainer import History, Log, Schedule, fit
from geomotion.types import Float, Tensor

logger = logging.getLogger(__name__)

Build = Callable[[int], PoseVAE]
KMEANS_ROUNDS = 20
TYPICAL_STD = 0.03  # where the spreads start, in units of the data's size
TYPICAL_CONCENTRATION = 1000.0
NEXT_SEED = 7919  # between attempts


@dataclass(frozen=True)
class FittedManifold:
    """A trained network.

    Attributes:
        network: Encoder, decoder and spreads.
        health: Of its latent space.
        attempts: How many trainings of the means it took.
        histories: Logged losses of means and of spreads.
    """

    network: PoseVAE
    health: Health
    attempts: int
    histories: tuple[History, History]


def fit_manifold(
    data: PoseTrainingSet,
    config: ManifoldConfig,
    training: ManifoldTraining,
    build: Build,
    seed: int,
    checkpoint: Path,
    log: Log,
) -> FittedManifold:
    """Train; continues at `checkpoint` where an interrupted training stopped.

    Args:
        data: Demonstrations.
        config: Architecture.
        training: Weights and steps.
        build: Makes an untrained network from a seed.
        seed: Of the first attempt.
        checkpoint: Where progress is kept; each phase has a file of its own beside it.
        log: Takes losses.

    Raises:
        DatasetError: If there are fewer poses than kernels.
        TrainingDiverged: If a loss becomes infinite.
        Interrupted: If a signal arrived.
    """
    poses, progress = data.tensors(config.mixed_copies, config.antipodal is not Antipodal.aligned, seed)
    if len(poses) < config.kernels:
        found = f"{len(poses)} poses to train on, fewer than manifold.kernels={config.kernels}"
        raise DatasetError("demonstrations", f"{found}; lower it, or raise manifold.points")
    objective = PoseReconstruction(poses, progress, training, config.antipodal)
    means = checkpoint.with_name(f"{checkpoint.name}.means")
    best: tuple[Health, PoseVAE, History] | None = None
    for attempt in range(training.restarts + 1):
        own = seed + NEXT_SEED * attempt
        network = build(own)
        schedule = _schedule(training, training.steps, training.learning_rate, own)
        history = fit(network, objective, schedule, means.with_name(f"{means.name}{attempt}"), log)
        health = _health(network, data, config)
        if best is None or health.score > best[0].score:
            best = health, network, history
        if health.is_good:
            break
        logger.warning(
            "train: the latent space of attempt %d is not good: %.1f %% of the variance is missed, %.1f %% is folded",
            attempt + 1,
            100 * health.unexplained,
            100 * health.folded,
        )
    assert best is not None
    health, network, history = best
    _place_kernels(network, poses, progress, config, seed)
    spreads = _fit_spreads(network, poses, progress, config, training, seed, checkpoint, log)
    for number in range(attempt + 1):
        means.with_name(f"{means.name}{number}").unlink(missing_ok=True)
    return FittedManifold(network, health, attempt + 1, (history, spreads))


def _schedule(training: ManifoldTraining, steps: int, learning_rate: float, seed: int) -> Schedule:
    return Schedule(
        steps,
        learning_rate,
        min(training.ramp_steps, steps),
        training.gradient_clip,
        training.checkpoint_every_steps,
        training.log_every_steps,
        seed,
    )


def _health(network: PoseVAE, data: PoseTrainingSet, config: ManifoldConfig) -> Health:
    poses, progress = data.tensors(0, False, 0)
    with torch.no_grad():
        codes = torch.split(network.encode(poses, progress)[0], [len(path) for path in data.paths])
    return judge(network, poses, progress, mean_distance_between(codes, data.groups), config.antipodal)


def _place_kernels(
    network: PoseVAE,
    poses: Float[Tensor, "point D"],
    progress: Float[Tensor, " point"],
    config: ManifoldConfig,
    seed: int,
) -> None:
    """Kernels at the centres of clusters of the codes, as wide as a multiple of their median spacing (Sec. 3.5.5)."""
    with torch.no_grad():
        codes = network.encode(poses, progress)[0].double().numpy()
    centres, _ = kmeans2(codes, config.kernels, KMEANS_ROUNDS, minit="++", rng=np.random.default_rng(seed))
    spacing = float(np.median(cKDTree(centres).query(centres, k=2)[0][:, 1]))
    placed = torch.as_tensor(centres, dtype=torch.float32)
    network.precision.place(placed, config.bandwidth * spacing, 1 / TYPICAL_STD)
    network.concentration.place(placed, config.bandwidth * spacing, TYPICAL_CONCENTRATION)


def _fit_spreads(
    network: PoseVAE,
    poses: Float[Tensor, "point D"],
    progress: Float[Tensor, " point"],
    config: ManifoldConfig,
    training: ManifoldTraining,
    seed: int,
    checkpoint: Path,
    log: Log,
) -> History:
    for name, parameter in network.named_parameters():
        parameter.requires_grad_(name.startswith(("precision", "concentration")))
    objective = SpreadLikelihood(poses, progress, training.batch_points, config.antipodal)
    schedule = _schedule(training, training.spread_steps, training.spread_learning_rate, seed)

    def log_later(step: int, values: dict[str, float]) -> None:
        log(training.steps + step, {f"spread.{name}": value for name, value in values.items()})

    history = fit(network, objective, schedule, checkpoint, log_later)  # type: ignore[arg-type]
    network.requires_grad_(True)
    return history
