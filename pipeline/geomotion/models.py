"""Models from configuration, and the file they are kept in."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from dataclasses import field as default
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from geomotion import config as schema
from geomotion.baseline_models import build_anchored
from geomotion.baselines.unconstrained import UnconstrainedLineIntegral
from geomotion.baselines.velocity_network import VelocityNetwork
from geomotion.dynamics.charts import AnchoredChart, ComposedChart, IdentityChart, ScalingChart, TurnedChart
from geomotion.dynamics.conditional import ConditionalLineIntegral, Standing
from geomotion.dynamics.conditional_linear import ConditionalLinear
from geomotion.dynamics.embedded import EmbeddedField, RisingClock
from geomotion.dynamics.fields import Chart, ChartedField, SkillField, VectorField
from geomotion.dynamics.injective import DecoderChart, decoded
from geomotion.dynamics.line_integral import DormandPrince, LineIntegralField, LineIntegrator, RungeKutta4
from geomotion.dynamics.linear import LinearField
from geomotion.dynamics.potential import PotentialField
from geomotion.dynamics.quadrature import GaussLegendre
from geomotion.dynamics.regularisers import (
    ConstantRegulariser,
    EigenvalueRegulariser,
    Regulariser,
    StateDependentRegulariser,
    StateIndependentRegulariser,
    unequal_roots,
)
from geomotion.dynamics.start_memory import StartMemory
from geomotion.dynamics.time_law import ConditionalTimeLaw, SplineTimeLaw
from geomotion.errors import CorruptArtefact, InvalidSetting
from geomotion.files import write_tensors
from geomotion.lie.poses import POSE_DIM, PoseCoordinates
from geomotion.networks.coupling import CouplingFlow
from geomotion.networks.mlp import MLP, JacobianRoot, SkewMatrix
from geomotion.networks.spline_flow import SplineFlow
from geomotion.training.data import Geometry

BY_CONSTRUCTION = "this field contracts by construction; its rate is at least field.min_rate_per_duration"
UNCONSTRAINED = "this field has no negative definite matrix, which alone ε belongs to"
JOINT_CHANNEL = "joints_rad"
FORMAT = 2  # of the model file; raised when older files can no longer be read


@dataclass(frozen=True)
class ModelConfig:
    """Everything that decides a model's architecture.

    Attributes:
        chart: ψ.
        field: The field in its coordinates.
        regulariser: ε of a line-integral field.
        seed: Seed of the initial parameters.
        time_law: How fast its motion runs at each time after the start.
    """

    chart: schema.ChartConfig
    field: schema.FieldConfig
    regulariser: schema.RegulariserConfig
    seed: int
    time_law: schema.TimeLawConfig = default(default_factory=schema.NoTimeLaw)


@dataclass(frozen=True)
class Skill:
    """A trained field with what is needed to use and to judge it.

    Attributes:
        field: The field in robot coordinates [m] and [m/s].
        geometry: Place, size and time scale of the demonstrations.
        state_channels: Channels of the demonstrations that make up the state.
        train_demos: Numbers of the demonstrations it was fitted to.
        test_demos: Numbers of those that were held out.
        pose: What turns poses into states, or into their last coordinates, where these are or have poses.
    """

    field: ChartedField
    config: ModelConfig
    geometry: Geometry
    state_channels: tuple[str, ...]
    train_demos: tuple[int, ...]
    test_demos: tuple[int, ...]
    pose: PoseCoordinates | None = None

    @property
    def goal(self) -> torch.Tensor:
        """Where the demonstrations end, shape (D,) [m], in the model's precision."""
        return torch.tensor(self.geometry.goal, dtype=next(self.field.parameters()).dtype)

    def begun(self, start: np.ndarray) -> "Skill":
        """The skill for the motion from this start, which it may remember."""
        return replace(self, field=self.field.begun(torch.as_tensor(start).to(self.goal)))

    @property
    def joints(self) -> int:
        """How many of the first coordinates of a state are joint positions [rad]; 0 beside anything but a pose."""
        if self.state_channels[0] != JOINT_CHANNEL or (self.pose is None and len(self.state_channels) > 1):
            return 0
        return len(self.geometry.goal) - self.geometry.context - (POSE_DIM if self.pose is not None else 0)


def build(config: ModelConfig, geometry: Geometry) -> ChartedField:
    """An untrained model, of states and codes where the geometry has context; the same seed gives the same parameters.

    Raises:
        InvalidSetting: If chart, field and regulariser do not go together, or the field knows no conditions.
    """
    context = geometry.context
    if isinstance(config.chart, schema.InjectiveVaeChart):
        decoder = build_decoder(config.chart, geometry, config.seed)
        codes = Geometry.of_prior(config.chart.latent_dim, geometry.duration_s)
        return decoded(decoder, build(of_codes(config), codes))
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed)
        scaling = ScalingChart(torch.tensor(geometry.centre), geometry.scale_m)
        dim = scaling.dim - context
        chart = ComposedChart(scaling, _chart(config.chart, dim, geometry))
        match config.field:
            case schema.LinearField() | schema.PotentialField() as exact:
                _refuse_regulariser(config.regulariser, BY_CONSTRUCTION)
                anchored: Chart = AnchoredChart(chart, torch.tensor(geometry.goal))
                field, law = _exact_field(exact, dim, context), _time_law(config.time_law, context)
                has_own_clock = isinstance(field, SkillField) and law is not None
                transverse = RisingClock(exact.transverse_start, exact.transverse_rise) if has_own_clock else None
                # a condition moves where motions start from
                memory = _start_memory(exact, dim, geometry) if transverse is not None and not context else None
                return ChartedField(anchored, field, geometry.duration_s, law, transverse, memory)
            case _ if not isinstance(config.time_law, schema.NoTimeLaw):
                raise InvalidSetting("time_law", "learned", "none, but for field=linear and field=potential")
            case schema.AnchoredField() as anchored_field:
                _refuse_regulariser(config.regulariser, UNCONSTRAINED)
                _refuse_conditions(context)
                around_goal = AnchoredChart(chart, torch.tensor(geometry.goal))
                return ChartedField(around_goal, build_anchored(anchored_field, dim), geometry.duration_s)
            case schema.VelocityNetworkField() as network:
                _refuse_regulariser(config.regulariser, UNCONSTRAINED)
                _refuse_conditions(context)
                velocity = VelocityNetwork(scaling.dim, network.hidden_units, network.activation.value)
                return ChartedField(chart, velocity, geometry.duration_s)
            case schema.LineIntegralField() as integral:
                integrated = _line_integral(integral, config.regulariser, chart, geometry)
                if context and isinstance(integrated, LineIntegralField):
                    return ChartedField(chart, ConditionalLineIntegral(integrated, context), geometry.duration_s)
                return ChartedField(chart, integrated, geometry.duration_s)
            case unknown:
                raise TypeError(f"no builder for {type(unknown).__name__}")


def build_decoder(config: schema.InjectiveVaeChart, geometry: Geometry, seed: int) -> DecoderChart:
    """An untrained decoder of states, which are scaled into the range of its splines.

    Raises:
        InvalidSetting: If states have no more coordinates than codes, or belong to conditions.
    """
    _refuse_conditions(geometry.context, "chart=flow or chart=identity")
    dim = len(geometry.centre)
    if config.latent_dim >= dim:
        raise InvalidSetting("chart.latent_dim", config.latent_dim, f"fewer than the {dim} coordinates of a state")
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        flow = SplineFlow(dim, config.layers, config.bins, config.bound, config.blocks, config.units)
    scaling = ScalingChart(torch.tensor(geometry.centre), geometry.scale_m / (config.filled * config.bound))
    return DecoderChart(scaling, flow, config.latent_dim)


def of_codes(config: ModelConfig) -> ModelConfig:
    """The model that is learned of codes where there is a decoder; otherwise the same as that of states."""
    if not isinstance(config.chart, schema.InjectiveVaeChart):
        return config
    chart = schema.IdentityChart() if config.chart.code_flow is None else config.chart.code_flow
    field = config.field
    if isinstance(field, schema.ExactField):  # starts are states, and not codes
        field = replace(field, start_fade_durations=None)
    return replace(config, chart=chart, field=field)


def _time_law(config: schema.TimeLawConfig, context: int) -> SplineTimeLaw | ConditionalTimeLaw | None:
    if not isinstance(config, schema.LearnedTimeLaw):
        return None
    settings = config.knots, config.min_speed
    return ConditionalTimeLaw(context, *settings) if context else SplineTimeLaw(*settings)


def _start_memory(config: schema.ExactField, dim: int, geometry: Geometry) -> StartMemory | None:
    durations = config.start_fade_durations
    return None if durations is None else StartMemory(dim, durations * geometry.duration_s)


FIELDS_WITH_CONDITIONS = "a field that knows them: field=linear, potential or line_integral"


def _refuse_conditions(context: int, expected: str = FIELDS_WITH_CONDITIONS) -> None:
    if context:
        raise InvalidSetting("dataset", "one with conditions", expected)


def _chart(config: schema.ChartConfig, dim: int, geometry: Geometry) -> Chart:
    context = geometry.context
    match config:
        case schema.IdentityChart():
            return IdentityChart(dim + context)
        case schema.FlowChart():
            if dim < 2:
                raise InvalidSetting("chart", "flow", "at least two coordinates; use chart=identity in one dimension")
            settings = config.layers, config.features, config.length_scales, config.log_scale_cap
            flow = CouplingFlow(dim, *settings, context)
            if not geometry.axes:
                return flow
            # halves of the principal axes say more about each other than halves of arbitrary coordinates
            return ComposedChart(TurnedChart(torch.tensor(geometry.axes).view(dim, dim)), flow)
        case unknown:
            raise TypeError(f"no builder for {type(unknown).__name__}")


def _exact_field(config: schema.ExactField, dim: int, context: int) -> VectorField:
    skill_dim = dim if config.skill_dim is None else config.skill_dim
    if skill_dim > dim:
        raise InvalidSetting("field.skill_dim", skill_dim, f"at most {dim}, the number of coordinates of a state")
    match config:
        case schema.PotentialField():
            rates = config.min_rate_per_duration, config.initial_rate_per_duration
            skill: LinearField | PotentialField = PotentialField(skill_dim, config.units, *rates)
        case schema.LinearField():
            rates = config.min_rate_per_duration, config.initial_rate_per_duration
            if context and skill_dim == dim:
                return ConditionalLinear(dim, context, *rates)
            skill = LinearField(skill_dim, *rates)
        case unknown:
            raise TypeError(f"no builder for {type(unknown).__name__}")
    field = skill if skill_dim == dim else EmbeddedField(skill, dim, config.transverse_rate_per_duration)
    return Standing(field, context) if context else field


def _line_integral(
    config: schema.LineIntegralField, regulariser: schema.RegulariserConfig, chart: Chart, geometry: Geometry
) -> LineIntegralField | UnconstrainedLineIntegral:
    base = torch.tensor(geometry.goal if config.base_point is schema.BasePoint.target else geometry.mean)
    dim, context = chart.dim - geometry.context, geometry.context
    with torch.no_grad():
        base_point = chart.to_latent(base)[:dim]
    base_velocity = torch.zeros_like(base_point)
    if config.skew and dim < 2:
        raise InvalidSetting("field.skew", True, "false in one dimension, where only 0 is skew-symmetric")
    if config.base_point is schema.BasePoint.learned:
        base_point = nn.Parameter(base_point)
    if config.base_velocity is schema.BaseVelocity.learned:
        base_velocity = nn.Parameter(base_velocity)
    layers = dim, config.hidden_units, config.activation.value, context
    matrix = JacobianRoot(*layers)
    if config.jacobian is schema.JacobianForm.unconstrained:
        _refuse_conditions(context)
        _refuse_regulariser(regulariser, UNCONSTRAINED)
        if config.skew:
            raise InvalidSetting("field.skew", True, "false where field.jacobian=unconstrained has a skew part already")
        return UnconstrainedLineIntegral(matrix, base_point, base_velocity, _integrator(config))
    epsilon = _regulariser(regulariser, dim, context)
    skew = SkewMatrix(*layers) if config.skew else None
    return LineIntegralField(matrix, epsilon, base_point, base_velocity, _integrator(config), skew)


def _integrator(config: schema.LineIntegralField) -> LineIntegrator:
    match config.integrator:
        case schema.Integrator.quadrature:
            return GaussLegendre(config.nodes)
        case schema.Integrator.rk4:
            return RungeKutta4(config.nodes)
        case schema.Integrator.dopri5:
            return DormandPrince(config.relative_tolerance, config.absolute_tolerance)


def _regulariser(config: schema.RegulariserConfig, dim: int, context: int) -> Regulariser:
    match config:
        case schema.ConstantRegulariser():
            return ConstantRegulariser(config.epsilon, dim)
        case schema.StateIndependentRegulariser():
            return StateIndependentRegulariser(config.initial_epsilon, dim, config.spread_weight, config.spread_limit)
        case schema.StateDependentRegulariser():
            root = MLP(dim + context, dim, config.hidden_units, config.activation.value)
            root.start_at(unequal_roots(config.initial_epsilon, dim))
            return StateDependentRegulariser(root, config.spread_weight, config.spread_limit)
        case schema.EigenvalueRegulariser():
            return EigenvalueRegulariser(config.epsilon, dim, config.spread_weight, config.spread_limit)
        case _:
            raise InvalidSetting("regulariser", "none", "a regulariser for field=line_integral, such as constant")


def _refuse_regulariser(config: schema.RegulariserConfig, reason: str) -> None:
    if not isinstance(config, schema.NoRegulariser):
        raise InvalidSetting("regulariser", type(config).__name__, f"none: {reason}")


def save(path: Path, skill: Skill, conditioning: Mapping[str, Any] | None = None) -> None:
    """Write a model: parameters, architecture and scaling in one file.

    Args:
        path: Where to.
        skill: The model.
        conditioning: What turns conditions into states of the model, in plain types; None for a model without.
    """
    document = {
        "format": FORMAT,
        "config": schema.plain(skill.config),
        "geometry": asdict(skill.geometry),
        "state_channels": list(skill.state_channels),
        "train_demos": list(skill.train_demos),
        "test_demos": list(skill.test_demos),
        "parameters": skill.field.state_dict(),
        "conditioning": conditioning,
        "pose": None if skill.pose is None else skill.pose.document(),
    }
    write_tensors(path, document)


def load(path: Path) -> Skill:
    """Read a model without conditions.

    Raises:
        CorruptArtefact: If the file is damaged or of another format.
        InvalidSetting: If its motion depends on a condition.
    """
    skill, conditioning = load_parts(path)
    if conditioning is not None:
        names = ", ".join(conditioning["names"])
        raise InvalidSetting(
            "condition", "null", f"numbers for {names}: {path} is conditional, see geomotion.conditional_models.load"
        )
    return skill


def load_parts(path: Path) -> tuple[Skill, Mapping[str, Any] | None]:
    """Read a model, of states and codes if it comes with conditions, and what :func:`save` was told of these.

    Raises:
        CorruptArtefact: If the file is damaged or of another format.
    """
    try:
        document = torch.load(path, weights_only=True)
        if document["format"] != FORMAT:
            raise CorruptArtefact(path, f"model format {document['format']}, this version reads {FORMAT}")
        geometry = Geometry(**{name: _tuple(value) for name, value in document["geometry"].items()})
        config = _model_config(document["config"])
        field = build(config, geometry)
        field.load_state_dict(document["parameters"])
    except (CorruptArtefact, InvalidSetting):
        raise
    except Exception as error:  # torch reports damage by many types
        raise CorruptArtefact(path, "this model file cannot be read") from error
    field.eval()
    skill = Skill(
        field,
        config,
        geometry,
        tuple(document["state_channels"]),
        tuple(document["train_demos"]),
        tuple(document["test_demos"]),
        None if document.get("pose") is None else PoseCoordinates.from_document(document["pose"]),
    )
    return skill, document.get("conditioning")


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list | tuple) else value


def _model_config(document: Mapping[str, Any]) -> ModelConfig:
    parts = {name: _component(document[name]) for name in ("chart", "field", "regulariser", "time_law")}
    return ModelConfig(**parts, seed=int(document["seed"]))


def _component(document: Mapping[str, Any]) -> Any:
    """A configuration object from its plain form; the set of kinds is closed."""
    kinds: Sequence[type] = (
        schema.IdentityChart, schema.FlowChart, schema.InjectiveVaeChart,
        schema.LinearField, schema.PotentialField, schema.LineIntegralField, schema.VelocityNetworkField,
        schema.SedsField, schema.EuclideanizingFlowField, schema.ImitationFlowField, schema.ElcdField,
        schema.MovementPrimitiveField, schema.CustomField,
        schema.NoRegulariser, schema.ConstantRegulariser, schema.StateIndependentRegulariser,
        schema.StateDependentRegulariser, schema.EigenvalueRegulariser,
        schema.NoTimeLaw, schema.LearnedTimeLaw,
    )  # fmt: skip
    kind = {kind.__name__: kind for kind in kinds}[document["kind"]]
    settings = {name: value for name, value in document.items() if name != "kind"}
    if kind is schema.CustomField:  # whose settings are the user's, by whatever names
        return kind(**settings)
    values = {name: _value(value) for name, value in settings.items()}
    for name, enum in (
        ("activation", schema.Activation), ("base_point", schema.BasePoint),
        ("base_velocity", schema.BaseVelocity), ("integrator", schema.Integrator),
        ("jacobian", schema.JacobianForm), ("drift", schema.LatentDrift),
    ):  # fmt: skip
        if name in values:
            values[name] = enum(values[name])
    return kind(**values)


def _value(document: Any) -> Any:
    return _component(document) if isinstance(document, Mapping) and "kind" in document else document
