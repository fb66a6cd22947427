"""Training a manifold in stages: means, kernels, spreads; from another seed where the latent space is bad."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from scipy.cluster.vq import kmeans2
from scipy.spatial import cKDTree

from geomotion.config import ManifoldConfig, ManifoldTraining
from geomotion.errors import DatasetError
from geomotion.manifolds.density import mean_distance_between
from geomotion.networks.pose_vae import SPREADS
from geomotion.training.kinds import Kind, Network, kind_of
from geomotion.training.manifold import Health, judge
from geomotion.training.states import TrainingSet
from geomotion.training.trainer import History, Log, Schedule, fit
from geomotion.types import Float, Tensor

logger = logging.getLogger(__name__)

Build = Callable[[int], Network]
KMEANS_ROUNDS = 20
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

    network: Network
    health: Health
    attempts: int
    histories: tuple[History, History]


def fit_manifold(
    data: TrainingSet,
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
        DatasetError: If there are fewer states than kernels.
        TrainingDiverged: If a loss becomes infinite.
        Interrupted: If a signal arrived.
    """
    kind = kind_of(data, config)
    states, progress = kind.samples(config.mixed_copies, seed)
    if len(states) < config.kernels:
        found = f"{len(states)} points to train on, fewer than manifold.kernels={config.kernels}"
        raise DatasetError("demonstrations", f"{found}; lower it, or raise manifold.points")
    means = checkpoint.with_name(f"{checkpoint.name}.means")
    best: tuple[Health, Network, History] | None = None
    for attempt in range(training.restarts + 1):
        own = seed + NEXT_SEED * attempt
        network = build(own)
        schedule = _schedule(training, training.steps, training.learning_rate, own)
        objective = kind.means(states, progress, training)
        history = fit(network, objective, schedule, means.with_name(f"{means.name}{attempt}"), log)
        health = _health(network, data, kind)
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
    _place_kernels(network, states, progress, config, seed)
    spreads = _fit_spreads(network, kind.spreads(states, progress, training), training, seed, checkpoint, log)
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


def _health(network: Network, data: TrainingSet, kind: Kind) -> Health:
    states, progress = data.tensors(0, 0)
    with torch.no_grad():
        codes = torch.split(network.encode(states, progress)[0], [len(path) for path in data.paths])
    return judge(network, states, progress, mean_distance_between(codes, data.groups), kind.orientation_at)


def _place_kernels(
    network: Network,
    states: Float[Tensor, "point D"],
    progress: Float[Tensor, " point"],
    config: ManifoldConfig,
    seed: int,
) -> None:
    """Kernels at the centres of clusters of the codes, as wide as a multiple of their median spacing (Sec. 3.5.5)."""
    with torch.no_grad():
        codes = network.encode(states, progress)[0].double().numpy()
    centres, _ = kmeans2(codes, config.kernels, KMEANS_ROUNDS, minit="++", rng=np.random.default_rng(seed))
    spacing = float(np.median(cKDTree(centres).query(centres, k=2)[0][:, 1]))
    network.place_kernels(torch.as_tensor(centres, dtype=torch.float32), config.bandwidth * spacing)


def _fit_spreads(
    network: Network, objective: Any, training: ManifoldTraining, seed: int, checkpoint: Path, log: Log
) -> History:
    for name, parameter in network.named_parameters():
        parameter.requires_grad_(name.startswith(SPREADS))
    schedule = _schedule(training, training.spread_steps, training.spread_learning_rate, seed)

    def log_later(step: int, values: dict[str, float]) -> None:
        log(training.steps + step, {f"spread.{name}": value for name, value in values.items()})

    history = fit(network, objective, schedule, checkpoint, log_later)  # type: ignore[arg-type]
    network.requires_grad_(True)
    return history
