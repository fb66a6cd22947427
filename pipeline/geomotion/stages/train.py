"""Fit a vector field to demonstrations."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
import torch

from geomotion import conditional_models, models
from geomotion import config as schema
from geomotion.conditional_models import ConditionalSkill
from geomotion.demos import storage
from geomotion.demos.conditions import condition_names
from geomotion.demos.demonstrations import Demonstrations
from geomotion.demos.selection import split, state_channels
from geomotion.dynamics.certificate import Certificate, certify
from geomotion.dynamics.conditional_certificate import for_all_conditions
from geomotion.dynamics.fields import ChartedField
from geomotion.errors import DatasetError, InvalidSetting
from geomotion.figures.training import save_training_figure
from geomotion.files import atomic, write_json
from geomotion.models import ModelConfig, Skill
from geomotion.tracking import Artefacts, StageRun
from geomotion.training.adjoint import TrajectoryShooting
from geomotion.training.conditioning import Conditioning, with_conditions
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
    selected = demonstrations.select(train_demos)
    shown = data = TrainingSet.from_demonstrations(selected, channels)
    geometry = Geometry.of(data)
    if geometry.scale_m == 0:
        raise DatasetError(demonstrations.name, "the training demonstrations stay where they start; expected motion")
    conditioning = _conditioning(config.model, selected, data) if selected.condition_names else None
    if conditioning is not None:
        data, geometry = with_conditions(data, _conditions(selected), conditioning)
    field = models.build(config.model, geometry)
    objective = _objective(config, data, geometry)
    history = fit(field, objective, _schedule(config, geometry), run.checkpoint, run.log_series)

    skill = Skill(field, config.model, geometry, channels, train_demos, test_demos)
    if conditioning is None:
        models.save(run.folder / "model.pt", skill)
        certificate = certify(field, data.all_states)
    else:
        conditional = ConditionalSkill(skill, conditioning)
        conditional_models.save(run.folder / "model.pt", conditional)
        certificate = _certify_conditions(conditional, selected, shown)
    write_json(run.folder / "certificate.json", certificate.as_dict())
    curves = pd.DataFrame(history.rows)
    with atomic(run.folder / "training.csv") as temporary:
        curves.to_csv(temporary, index=False)
    save_training_figure(curves, run.folder / "figures")


def _conditions(demonstrations: Demonstrations) -> np.ndarray:
    return np.array([trajectory.condition for trajectory in demonstrations.trajectories])


def _conditioning(model: ModelConfig, demonstrations: Demonstrations, data: TrainingSet) -> Conditioning:
    ends = torch.stack([states[-1] for states in data.states]).double().numpy()
    return Conditioning.fit(
        demonstrations.condition_names,
        condition_names(demonstrations),
        _conditions(demonstrations),
        ends,
        # the thesis' field learns of the target by its networks alone
        follows_goal=not isinstance(model.field, schema.LineIntegralField),
    )


def _certify_conditions(skill: ConditionalSkill, demonstrations: Demonstrations, data: TrainingSet) -> Certificate:
    """Each condition on the states that were shown with it."""
    certificates = []
    for condition in skill.conditions.values():
        pairs = zip(demonstrations.trajectories, data.states, strict=True)
        states = torch.cat([states for trajectory, states in pairs if trajectory.condition == condition])
        certificates.append(certify(skill.given(condition).field, states))
    return for_all_conditions(certificates)


def _objective(config: TrainConfig, data: TrainingSet, geometry: Geometry) -> Objective[ChartedField]:
    match config.training:
        case schema.VelocityTraining() as velocity:
            for name in ("curl_weight", "contraction_weight"):
                weight = getattr(velocity, name)
                if weight > 0 and isinstance(config.model.regulariser, schema.NoRegulariser):
                    raise InvalidSetting(f"training.{name}", weight, "0: it is for field=line_integral with its Ĵ")
            return VelocityReconstruction(data, geometry, velocity)
        case schema.TrajectoryTraining() as trajectory:
            if not isinstance(config.model.field, schema.LinearField):
                raise InvalidSetting("training", "trajectory", "velocity: this field has no closed-form trajectories")
            return TrajectoryReproduction(data, geometry, trajectory)
        case schema.AdjointTraining() as adjoint:
            return TrajectoryShooting(data, geometry, adjoint)
        case unknown:
            raise TypeError(f"no objective for {type(unknown).__name__}")


def _schedule(config: TrainConfig, geometry: Geometry) -> Schedule:
    """The weights under a condition are a sum, which moves farther in a step than each of its terms."""
    training = config.training
    slower = (1 + geometry.context) ** 0.5
    return Schedule(
        training.steps,
        training.learning_rate / slower,
        training.ramp_steps,
        training.gradient_clip,
        training.checkpoint_every_steps,
        training.log_every_steps,
        config.seed,
    )
