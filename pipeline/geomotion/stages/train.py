"""Fit a vector field to demonstrations."""

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field as default

import numpy as np
import pandas as pd
import torch

from geomotion import conditional_models, models
from geomotion import config as schema
from geomotion.conditional_models import ConditionalSkill
from geomotion.demos import storage
from geomotion.demos.conditions import condition_names
from geomotion.demos.demonstrations import Demonstrations
from geomotion.demos.pose_vectors import POSE_CHANNEL, fit_pose_coordinates, with_pose_vectors
from geomotion.demos.selection import split, state_channels
from geomotion.dynamics.certificate import Certificate, certify
from geomotion.dynamics.conditional_certificate import for_all_conditions
from geomotion.dynamics.embedded import EmbeddedField
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.injective import decoded
from geomotion.errors import DatasetError, InvalidSetting
from geomotion.figures.training import save_training_figure
from geomotion.files import atomic, write_json
from geomotion.lie.poses import Group, PoseCoordinates
from geomotion.models import JOINT_CHANNEL, ModelConfig, Skill
from geomotion.stages.train_decoder import train_decoder
from geomotion.tracking import Artefacts, StageRun
from geomotion.training.adjoint import TrajectoryShooting
from geomotion.training.conditioning import Conditioning, with_conditions
from geomotion.training.data import Geometry, TrainingSet
from geomotion.training.injective_vae import encoded
from geomotion.training.likelihood import TransitionLikelihood
from geomotion.training.nearest_path import path_nearest_to
from geomotion.training.objectives import VelocityReconstruction
from geomotion.training.start import mean_square_distance, start_from_data
from geomotion.training.trainer import History, Objective, Schedule, fit
from geomotion.training.trajectories import TrajectoryReproduction

POSES = (schema.PoseSpace.R3xSO3, schema.PoseSpace.R3xS3)
POSE_PARTS = (3, 3)  # positions and orientations are judged apart
LEVER_BESIDE_JOINTS_M = 1.0  # so that a turn counts as much as the same turn of a joint


@dataclass(frozen=True)
class TrainConfig:
    """What the train stage needs.

    Attributes:
        selection: Demonstrations to fit and to hold out, and the channels that make up the state.
        model: Architecture.
        training: Objective and schedule.
        seed: Seed of the optimisation.
        space: Where states live, if they are poses.
        pose: How poses become vectors.
        vae: Training of a decoder, where the chart is one.
    """

    selection: schema.DatasetConfig
    model: ModelConfig
    training: schema.TrainingConfig
    seed: int
    space: schema.PoseSpace | None = None
    pose: schema.PoseConfig = default(default_factory=schema.PoseConfig)
    vae: schema.VaeTraining = default(default_factory=schema.VaeTraining)


def train(config: TrainConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``model.pt``, ``certificate.json``, ``training.json``, ``training.csv`` and its picture.

    Raises:
        DatasetError: If nothing moves in the demonstrations.
        InvalidSetting: If settings do not go together, or do not fit the demonstrations.
        TrainingDiverged: If a loss or a parameter becomes infinite again and again.
        Interrupted: If a signal arrived.
    """
    demonstrations = storage.load(inputs["ingest"].folder)
    train_demos, test_demos = split(config.selection, demonstrations)
    coordinates = _pose_coordinates(config, demonstrations.select(train_demos))
    demonstrations = with_pose_vectors(demonstrations, coordinates)
    channels = _channels(config, demonstrations)
    selected = demonstrations.select(train_demos)
    shown = data = TrainingSet.from_demonstrations(selected, channels)
    geometry = Geometry.of(data)
    if geometry.scale_m == 0:
        raise DatasetError(demonstrations.name, "the training demonstrations stay where they start; expected motion")
    conditioning = _conditioning(config.model, selected, data) if selected.condition_names else None
    if conditioning is not None:
        data, geometry = with_conditions(data, _conditions(selected), conditioning)
    decoder = None
    seen, place = data, geometry
    if isinstance(config.model.chart, schema.InjectiveVaeChart):
        decoder = train_decoder(config.model.chart, config.vae, data, geometry, config.seed, run)
        seen = encoded(data, decoder)
        place = Geometry.of(seen)
    field = models.build(models.of_codes(config.model), place)
    if field.start_memory is not None:
        field.start_memory.learn(torch.stack([states[0] for states in seen.states]))
        seen = seen.without_offsets(field.start_memory)
    started = start_from_data(field, seen)
    if isinstance(config.training, schema.ClosedFormTraining):
        history = _closed_form(config, started, field, seen, place)
    else:
        objective = _objective(config, seen, place)
        history = fit(field, objective, _schedule(config), run.checkpoint, run.log_series)
    if _is_one_path(config, field, seen):
        field.carry_to(path_nearest_to(seen, place, _parts(config)))
    elif field.start_memory is not None:
        field.begin_on_skill()
    if decoder is not None:
        field = decoded(decoder, field)

    skill = Skill(field, config.model, geometry, channels, train_demos, test_demos, coordinates)
    if conditioning is None:
        models.save(run.folder / "model.pt", skill)
        certificate = certify(field, data.all_states)
    else:
        conditional = ConditionalSkill(skill, conditioning)
        conditional_models.save(run.folder / "model.pt", conditional)
        certificate = _certify_conditions(conditional, selected, shown)
    write_json(run.folder / "certificate.json", certificate.as_dict())
    write_json(run.folder / "training.json", {"returns": [one.as_dict() for one in history.returns]})
    curves = pd.DataFrame(history.rows)
    with atomic(run.folder / "training.csv") as temporary:
        curves.to_csv(temporary, index=False)
    save_training_figure(curves, run.folder / "figures")


def _pose_coordinates(config: TrainConfig, demonstrations: Demonstrations) -> PoseCoordinates | None:
    if config.space is None:
        return None
    channels, beside = config.selection.state_channels, config.space is schema.PoseSpace.RnxR3xSO3
    if channels is not None and not (beside and channels == [JOINT_CHANNEL]):
        raise InvalidSetting("dataset.state_channels", channels, "null beside `space`")
    group: Group = "S3" if config.space is schema.PoseSpace.R3xS3 else "SO3"
    lever_m = config.pose.lever_m_per_rad or (LEVER_BESIDE_JOINTS_M if beside else None)
    return fit_pose_coordinates(demonstrations, group, config.pose.cover.value, lever_m)


def _channels(config: TrainConfig, demonstrations: Demonstrations) -> tuple[str, ...]:
    """Channels of the demonstrations, and of the poses in them, that make up the state."""
    if config.space is None:
        return state_channels(config.selection, demonstrations)
    if config.space is not schema.PoseSpace.RnxR3xSO3:
        return (POSE_CHANNEL,)
    if JOINT_CHANNEL not in demonstrations.channel_names:
        raise DatasetError(demonstrations.name, f"has no {JOINT_CHANNEL}; space={config.space.value} needs them")
    return JOINT_CHANNEL, POSE_CHANNEL


def _conditions(demonstrations: Demonstrations) -> np.ndarray:
    return np.array([trajectory.condition for trajectory in demonstrations.trajectories])


def _conditioning(model: ModelConfig, demonstrations: Demonstrations, data: TrainingSet) -> Conditioning:
    return Conditioning.fit(
        demonstrations.condition_names,
        condition_names(demonstrations),
        _conditions(demonstrations),
        data,
        # the thesis' field learns of the condition by its networks alone
        moves_frame=not isinstance(model.field, schema.LineIntegralField),
    )


def _certify_conditions(skill: ConditionalSkill, demonstrations: Demonstrations, data: TrainingSet) -> Certificate:
    """Each condition on the states that were shown with it."""
    certificates = []
    for condition in skill.conditions.values():
        pairs = zip(demonstrations.trajectories, data.states, strict=True)
        states = torch.cat([states for trajectory, states in pairs if trajectory.condition == condition])
        certificates.append(certify(skill.given(condition).field, states))
    return for_all_conditions(certificates)


def _closed_form(
    config: TrainConfig, started: bool, field: ChartedField, data: TrainingSet, geometry: Geometry
) -> History:
    """The only row of the history of a field that is computed from the demonstrations."""
    if not (started and field.is_solvable):
        raise InvalidSetting("training", "closed_form", "velocity or the like: this field has to be trained")
    distance = mean_square_distance(field.eval(), data, geometry)
    return History([{"step": 0.0, "total": distance, "learning_rate": 0.0}])


def _is_one_path(config: TrainConfig, field: ChartedField, data: TrainingSet) -> bool:
    asked_for = isinstance(config.training, schema.TrajectoryTraining) and config.training.one_path
    is_curve = isinstance(field.field, EmbeddedField) and field.field.skill_dim == 1
    return asked_for and field.start_memory is not None and is_curve and len(data.states) > 1


def _parts(config: TrainConfig) -> tuple[int, ...] | None:
    is_of_codes = isinstance(config.model.chart, schema.InjectiveVaeChart)
    return POSE_PARTS if config.space in POSES and not is_of_codes else None


def _objective(config: TrainConfig, data: TrainingSet, geometry: Geometry) -> Objective[ChartedField]:
    if isinstance(config.model.field, schema.MovementPrimitiveField):
        found = type(config.training).__name__.removesuffix("Training").lower()
        raise InvalidSetting("training", found, "closed_form: a movement primitive is computed from the demonstrations")
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
            return TrajectoryReproduction(data, geometry, trajectory, _parts(config))
        case schema.AdjointTraining() as adjoint:
            return TrajectoryShooting(data, geometry, adjoint)
        case schema.LikelihoodTraining() as likelihood:
            if not isinstance(config.model.field, schema.ImitationFlowField):
                raise InvalidSetting("training", "likelihood", "velocity: this field is not stochastic")
            return TransitionLikelihood(data, geometry, likelihood)
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
