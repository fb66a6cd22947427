"""Fit a vector field to demonstrations."""

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from geomotion import config as schema
from geomotion import models
from geomotion.demos import storage
from geomotion.demos.selection import split, state_channels
from geomotion.dynamics.certificate import certify
from geomotion.dynamics.fields import ChartedField
from geomotion.errors import DatasetError, InvalidSetting
from geomotion.figures.training import save_training_figure
from geomotion.files import atomic, write_json
from geomotion.models import ModelConfig, Skill
from geomotion.tracking import Artefacts, StageRun
from geomotion.training.data import Geometry, TrainingSet
from geomotion.training.objectives import VelocityReconstruction
from geomotion.training.trainer import Objective, Schedule, fit
from geomotion.training.trajectories import TrajectoryReproduction


@dataclass(frozen=True)
class TrainConfig:
    """What the train stage needs.

    Attributes:
        selection: Demonstrations to fit and to hold out, and the channels that make up the state.
        model: Architecture.
        training: Objective and schedule.
        seed: Seed of the optimisation.
    """

    selection: schema.DatasetConfig
    model: ModelConfig
    training: schema.TrainingConfig
    seed: int


def train(config: TrainConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``model.pt``, ``certificate.json``, ``training.csv`` and its picture.

    Raises:
        DatasetError: If nothing moves in the demonstrations.
        InvalidSetting: If settings do not go together, or do not fit the demonstrations.
        TrainingDiverged: If a loss or a parameter becomes infinite.
        Interrupted: If a signal arrived.
    """
    demonstrations = storage.load(inputs["ingest"].folder)
    channels = state_channels(config.selection, demonstrations)
    train_demos, test_demos = split(config.selection, demonstrations)
    data = TrainingSet.from_demonstrations(demonstrations.select(train_demos), channels)
    geometry = Geometry.of(data)
    if geometry.scale_m == 0:
        raise DatasetError(demonstrations.name, "the training demonstrations stay where they start; expected motion")
    field = models.build(config.model, geometry)
    history = fit(field, _objective(config, data, geometry), _schedule(config), run.checkpoint, run.log_series)

    skill = Skill(field, config.model, geometry, channels, train_demos, test_demos)
    models.save(run.folder / "model.pt", skill)
    write_json(run.folder / "certificate.json", certify(field, data.all_states).as_dict())
    curves = pd.DataFrame(history.rows)
    with atomic(run.folder / "training.csv") as temporary:
        curves.to_csv(temporary, index=False)
    save_training_figure(curves, run.folder / "figures")


def _objective(config: TrainConfig, data: TrainingSet, geometry: Geometry) -> Objective[ChartedField]:
    match config.training:
        case schema.VelocityTraining() as velocity:
            if velocity.curl_weight > 0 and not isinstance(config.model.field, schema.LineIntegralField):
                raise InvalidSetting("training.curl_weight", velocity.curl_weight, "0: only field=line_integral has Ĵ")
            return VelocityReconstruction(data, geometry, velocity)
        case schema.TrajectoryTraining() as trajectory:
            if not isinstance(config.model.field, schema.LinearField):
                raise InvalidSetting("training", "trajectory", "velocity: this field has no closed-form trajectories")
            return TrajectoryReproduction(data, geometry, trajectory)
        case unknown:
            raise TypeError(f"no objective for {type(unknown).__name__}")


def _schedule(config: TrainConfig) -> Schedule:
    training = config.training
    return Schedule(
        training.steps,
        training.learning_rate,
        training.ramp_steps,
        training.gradient_clip,
        training.checkpoint_every_steps,
        training.log_every_steps,
        config.seed,
    )
