"""Fit a manifold of poses to demonstrations."""

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from geomotion import config as schema
from geomotion import manifold_models
from geomotion.demos import storage
from geomotion.demos.demonstrations import Demonstrations
from geomotion.demos.poses import pose_paths
from geomotion.demos.selection import split
from geomotion.errors import DatasetError
from geomotion.figures.training import save_training_figure
from geomotion.files import atomic, write_json
from geomotion.manifold_models import PoseSkill
from geomotion.networks.pose_vae import PoseVAE
from geomotion.tracking import Artefacts, StageRun
from geomotion.training.manifold_fit import FittedManifold, fit_manifold
from geomotion.training.poses import PoseTrainingSet

STILL_M = 1e-4  # positions that vary less do not move


@dataclass(frozen=True)
class TrainManifoldConfig:
    """What the train stage of `gms` needs.

    Attributes:
        selection: Demonstrations to fit and to hold out.
        manifold: Architecture.
        training: Weights and schedule.
        seed: Of parameters and optimisation.
    """

    selection: schema.DatasetConfig
    manifold: schema.ManifoldConfig
    training: schema.ManifoldTraining
    seed: int


def train_manifold(config: TrainManifoldConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``model.pt``, ``training.json``, ``training.csv`` and its picture.

    Raises:
        DatasetError: If the demonstrations hold no poses, or nothing moves.
        TrainingDiverged: If a loss or a parameter becomes infinite.
        Interrupted: If a signal arrived.
    """
    demonstrations = storage.load(inputs["ingest"].folder)
    train_demos, test_demos = split(config.selection, demonstrations)
    data = training_set(demonstrations, train_demos, config.manifold)
    if data.geometry.scale_m < STILL_M:
        raise DatasetError(
            demonstrations.name, "the positions of the training demonstrations stay where they start; expected motion"
        )

    def build(seed: int) -> PoseVAE:
        return manifold_models.build(config.manifold, data.geometry, seed)

    fitted = fit_manifold(data, config.manifold, config.training, build, config.seed, run.checkpoint, run.log_series)
    skill = PoseSkill(fitted.network, config.manifold, data.geometry, train_demos, test_demos)
    manifold_models.save(run.folder / "model.pt", skill)
    write_json(run.folder / "training.json", _document(fitted))
    curves = pd.DataFrame(fitted.histories[0].rows)
    for name, table in (("training", curves), ("spreads", pd.DataFrame(fitted.histories[1].rows))):
        with atomic(run.folder / f"{name}.csv") as temporary:
            table.to_csv(temporary, index=False)
    save_training_figure(curves, run.folder / "figures")


def training_set(
    demonstrations: Demonstrations, train_demos: tuple[int, ...], manifold: schema.ManifoldConfig
) -> PoseTrainingSet:
    """The demonstrations that a manifold is fitted to, prepared as its configuration says."""
    chosen = demonstrations.select(train_demos)
    return PoseTrainingSet.of(pose_paths(chosen, manifold.points), chosen.groups, manifold.carry_ends)


def _document(fitted: FittedManifold) -> dict[str, object]:
    return {
        "attempts": fitted.attempts,
        "unexplained_variance": fitted.health.unexplained,
        "folded_share": fitted.health.folded,
        "is_good": fitted.health.is_good,
    }
