"""Fit a manifold of poses, or of configurations, to demonstrations."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import pandas as pd

from geomotion import arms, manifold_models
from geomotion import config as schema
from geomotion.demos import storage
from geomotion.demos.demonstrations import Demonstrations
from geomotion.demos.selection import split
from geomotion.errors import DatasetError
from geomotion.figures.training import save_training_figure
from geomotion.files import atomic, write_json
from geomotion.manifold_models import Skill
from geomotion.scores.configurations import ConfigurationPath
from geomotion.scores.paths import MotionPath, PosePath
from geomotion.stages.states import is_of_joints, state_paths
from geomotion.tracking import Artefacts, StageRun
from geomotion.training.configurations import ConfigurationSpace
from geomotion.training.kinds import Network
from geomotion.training.manifold_fit import FittedManifold, fit_manifold
from geomotion.training.poses import PoseSpace
from geomotion.training.states import TrainingSet

STILL_M = 1e-4  # positions that vary less do not move
JOINT_DIVERGENCE_WEIGHT = 1.0  # configurations of several solutions fold more easily than poses


@dataclass(frozen=True)
class TrainManifoldConfig:
    """What the train stage of `gms` needs.

    Attributes:
        selection: Demonstrations to fit and to hold out.
        manifold: Architecture.
        training: Weights and schedule.
        seed: Of parameters and optimisation.
        space: Of what; None leaves it to the demonstrations.
        arm: Whose joints, where configurations are learned.
    """

    selection: schema.DatasetConfig
    manifold: schema.ManifoldConfig
    training: schema.ManifoldTraining
    seed: int
    space: schema.Space | None
    arm: schema.ArmConfig


def train_manifold(config: TrainManifoldConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``model.pt``, ``training.json``, ``training.csv`` and its picture.

    Raises:
        DatasetError: If the demonstrations do not hold such states, or nothing moves.
        TrainingDiverged: If a loss or a parameter becomes infinite.
        Interrupted: If a signal arrived.
    """
    demonstrations = storage.load(inputs["ingest"].folder)
    train_demos, test_demos = split(config.selection, demonstrations)
    arm = config.arm if is_of_joints(config.space, demonstrations) else None
    manifold = manifold_models.settled(config.manifold, arm)
    data = training_set(demonstrations, train_demos, manifold, arm)
    if data.space.scale_m < STILL_M:
        raise DatasetError(
            demonstrations.name, "the positions of the training demonstrations stay where they start; expected motion"
        )

    def build(seed: int) -> Network:
        return manifold_models.build(manifold, data.space, seed)

    training = config.training
    if arm is not None and training.divergence_weight is None:
        training = replace(training, divergence_weight=JOINT_DIVERGENCE_WEIGHT)
    fitted = fit_manifold(data, manifold, training, build, config.seed, run.checkpoint, run.log_series)
    skill = Skill(fitted.network, manifold, data.space, train_demos, test_demos, arm)
    manifold_models.save(run.folder / "model.pt", skill)
    write_json(run.folder / "training.json", _document(fitted))
    curves = pd.DataFrame(fitted.histories[0].rows)
    for name, table in (("training", curves), ("spreads", pd.DataFrame(fitted.histories[1].rows))):
        with atomic(run.folder / f"{name}.csv") as temporary:
            table.to_csv(temporary, index=False)
    save_training_figure(curves, run.folder / "figures")


def training_set(
    demonstrations: Demonstrations,
    train_demos: tuple[int, ...],
    manifold: schema.ManifoldConfig,
    arm: schema.ArmConfig | None,
) -> TrainingSet:
    """The demonstrations that a manifold is fitted to, prepared as its configuration says."""
    chosen = demonstrations.select(train_demos)
    paths = state_paths(chosen, manifold.points, arm)
    return TrainingSet.of(_space(paths, arm), paths, chosen.groups, manifold.carry_ends)


def _space(paths: Sequence[MotionPath], arm: schema.ArmConfig | None) -> PoseSpace | ConfigurationSpace:
    if arm is None:
        return PoseSpace.of([path for path in paths if isinstance(path, PosePath)])
    return ConfigurationSpace.of([path for path in paths if isinstance(path, ConfigurationPath)], arms.build(arm))


def _document(fitted: FittedManifold) -> dict[str, object]:
    return {
        "attempts": fitted.attempts,
        "unexplained_variance": fitted.health.unexplained,
        "folded_share": fitted.health.folded,
        "is_good": fitted.health.is_good,
        "returns": [one.as_dict() for history in fitted.histories for one in history.returns],
    }
