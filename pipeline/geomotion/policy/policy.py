"""What a control loop asks: a velocity for what it measures, and whether it can be trusted."""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import replace

import torch
from torch import nn

from geomotion.conditional_models import ConditionalPolicy, ConditionalSkill
from geomotion.demos.demonstrations import CHANNEL_UNITS
from geomotion.dynamics.charts import ComposedChart
from geomotion.dynamics.conditional import Standing
from geomotion.dynamics.embedded import EmbeddedField
from geomotion.dynamics.injective import DecoderChart
from geomotion.models import Skill
from geomotion.obstacles.safe_field import PLANE, SafeField
from geomotion.policy import ports
from geomotion.policy.ports import Input, Output, Status
from geomotion.policy.sphere import Avoidance, TensorSphere
from geomotion.policy.training_range import TrainingRange
from geomotion.types import Bool, State, Tensor, Velocity

ROTATION_TOLERANCE = 0.1  # of a quaternion's length; measured ones are shortened to one within it


class Policy(nn.Module):
    """(state[, condition][, time][, obstacle][, k][, start]) ↦ (velocity, status[, distance to the manifold][, S]).

    States are what the robot measures: positions, joints, or positions with orientations, whose velocities are those of
    the frame at rest. Of spheres told at run time, positions keep clear. In the group S³ the sign of a quaternion
    counts: it has to follow the motion, which starts on the side of the mean orientation. S is the distance that a
    safety region is made of. Where starts are remembered, the one that is told stays what it is while the motion lasts.

    Args:
        skill: Trained.
        training_range: Where it was demonstrated.
        avoidance: What a sphere in the way does.
    """

    def __init__(
        self, skill: Skill | ConditionalSkill, training_range: TrainingRange, avoidance: Avoidance | None = None
    ) -> None:
        super().__init__()
        plain = skill if isinstance(skill, Skill) else skill.augmented
        if isinstance(plain.field.field, SafeField):  # velocities change by their size within millimetres of a border
            plain = replace(plain, field=deepcopy(plain.field).double())
        self.conditional = None if isinstance(skill, Skill) else ConditionalPolicy(skill)
        self.field = plain.field
        self.pose = None if plain.pose is None else deepcopy(plain.pose).float()
        self.training_range = training_range
        self.avoidance = avoidance or Avoidance()
        self.scale_m = plain.geometry.scale_m
        self.dim = plain.field.dim - plain.geometry.context
        self.channels = plain.state_channels
        self.joints = plain.joints if self.pose is not None else 0  # in front of a pose
        self.embedded, self.decoder = _embedded(plain), _decoder(plain)
        self.safe = plain.field.field if isinstance(plain.field.field, SafeField) else None
        self.inputs = tuple(self._inputs())
        self.outputs = tuple(self._outputs())

    def float(self) -> "Policy":
        """Everything in single precision but a field with a safety region."""
        if self.safe is None:
            return super().float()
        for name, child in self.named_children():
            if name not in ("field", "embedded", "decoder", "safe"):
                child.float()
        return self

    @property
    def has_manifold(self) -> bool:
        """Whether the skill has fewer dimensions than its states."""
        return self.embedded is not None or self.decoder is not None

    def forward(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Values of :attr:`outputs` from those of :attr:`inputs`, in their order."""
        given = dict(zip((one.name for one in self.inputs), inputs, strict=True))
        exact, is_rotation = self._state(given)
        x = exact.to(inputs[0].dtype)
        conditions = [given[ports.CONDITION]] if self.conditional is not None else []
        stretch, slowdown = self._units(given)
        z, velocity = self._velocity(exact, given, stretch, slowdown)
        velocities = self._around_obstacle(x, velocity.to(x.dtype), given)
        is_defined = torch.cat(velocities, -1).isfinite().all(-1) & is_rotation
        is_inside = self.training_range.contains(x, conditions)
        status = torch.where(is_defined, torch.where(is_inside, Status.ok, Status.outside), Status.undefined)
        trusted = tuple(torch.where(is_defined[..., None], one, 0) for one in velocities)
        offset = self._offset(exact, z, stretch)
        told = [] if offset is None else [offset.norm(dim=-1)]
        if self.safe is not None:
            region = self.safe.region
            told.append(region.distance(z[..., :PLANE]).clamp(max=region.levels.inactive))
        return (*trusted, status, *(one.to(x.dtype) for one in told))

    def _state(self, given: Mapping[str, Tensor], when: str = "") -> tuple[State, Bool[Tensor, "*batch"]]:
        """x, now or at the start, in the precision of the field, and whether its orientation is a rotation."""
        precision = next((one.dtype for one in self.field.parameters()), torch.float32)
        if self.pose is None:
            x = given[when + self.inputs[0].name].to(precision)
            return x, torch.ones_like(x[..., 0], dtype=torch.bool)
        orientation = given[when + ports.ORIENTATION].to(precision)
        length = orientation.norm(dim=-1, keepdim=True)
        x = self.pose.to_vector(given[when + ports.POSITION].to(precision), orientation / length)
        if self.joints:
            x = torch.cat([given[when + ports.JOINTS].to(precision), x], dim=-1)
        return x, ((length - 1).abs() < ROTATION_TOLERANCE)[..., 0]

    def _units(self, given: Mapping[str, Tensor]) -> tuple[Tensor, Tensor]:
        """How much larger and slower the skill is under its condition."""
        if self.conditional is None:
            return torch.ones(()), torch.ones(())
        return self.conditional.units(given[ports.CONDITION])

    def _velocity(
        self, x: State, given: Mapping[str, Tensor], stretch: Tensor, slowdown: Tensor
    ) -> tuple[Tensor, Velocity]:
        """Latent state, with the code of a condition behind it, and ẋ."""
        field, augmented = self.field, x
        given = {name: value.to(x.dtype) for name, value in given.items()}
        carried = None
        if field.start_memory is not None:
            carried = field.start_memory.carried(self._state(given, ports.START)[0])
            augmented = x - carried.at(given[ports.ELAPSED])
        if self.conditional is not None:
            augmented = self.conditional.augmented(x, given[ports.CONDITION])
        z, push_forward = field.chart.linearise(augmented)
        latent = self._latent_velocity(z, given)
        if ports.ELAPSED in given:
            latent = field.paced(latent, given[ports.ELAPSED] / (field.time_unit_s * slowdown), field.law_at(z))
        velocity = stretch / (field.time_unit_s * slowdown) * push_forward(latent)[..., : self.dim]
        return z, velocity if carried is None else velocity + carried.velocity(given[ports.ELAPSED])

    def _latent_velocity(self, z: Tensor, given: Mapping[str, Tensor]) -> Tensor:
        """As the field has it, with the rate k that is asked for."""
        if self.embedded is None:
            velocity: Tensor = self.field.field(z)
            return velocity
        place = z[..., : self.embedded.skill_dim]
        across = z[..., self.embedded.skill_dim : self.embedded.dim]
        along = self.embedded.field(place)
        if self.safe is not None:
            along = self.safe.steered(place, along)
        parts = [along, -given[ports.TRANSVERSE_RATE] * across]
        return torch.cat([*parts, torch.zeros_like(z[..., self.embedded.dim :])], -1)

    def _offset(self, x: State, z: Tensor, stretch: Tensor) -> Tensor | None:
        """z_e in the size of the demonstrations [m]; None for skills of all dimensions."""
        if self.embedded is not None:
            return self.scale_m * stretch * z[..., self.embedded.skill_dim : self.embedded.dim]
        if self.decoder is not None:
            return self.decoder.scaling.scale * self.decoder.split(x)[1]
        return None

    def _around_obstacle(self, x: State, velocity: Velocity, given: Mapping[str, Tensor]) -> tuple[Tensor, ...]:
        """What is commanded: ẋ, or the velocity of the position and the angular one; the first clear of the ball."""
        position, moving, turning = x, velocity, tuple[Tensor, ...]()
        if self.pose is not None:
            twist = self.pose.twist(x[..., self.joints :], velocity[..., self.joints :])
            position, moving, turning = x[..., :3], twist.velocity, (twist.omega,)
            if self.joints:
                return velocity[..., : self.joints], moving, *turning
        if ports.OBSTACLE_RADIUS in given:
            place = given[ports.OBSTACLE_CENTRE], given[ports.OBSTACLE_RADIUS], given[ports.OBSTACLE_VELOCITY]
            moving = TensorSphere(*place).modulate(position, moving, self.avoidance)
        return moving, *turning

    def _inputs(self) -> list[Input]:
        if self.pose is not None:
            joints = [Input(ports.JOINTS, self.joints, "rad")] if self.joints else []
            found = [*joints, Input(ports.POSITION, 3, "m"), Input(ports.ORIENTATION, 4, "1")]
        else:
            name = ports.JOINTS if self.channels == (ports.JOINTS,) else ports.STATE
            found = [Input(name, self.dim, ", ".join(dict.fromkeys(CHANNEL_UNITS[one] for one in self.channels)))]
        if self.conditional is not None:
            found.append(Input(ports.CONDITION, self.conditional.condition_dim, "1"))
        if self.field.time_law is not None:
            found.append(Input(ports.ELAPSED, 1, "s"))
        place = 3 if self.pose is not None else self.dim
        is_body = self.pose is not None and not self.joints  # what carries joints is not all that must keep clear
        if place > 1 and (is_body or self.channels == (ports.POSITION,)):
            still = (0.0,) * place
            found.append(Input(ports.OBSTACLE_CENTRE, place, "m", still))
            found.append(Input(ports.OBSTACLE_RADIUS, 1, "m", (0.0,)))
            found.append(Input(ports.OBSTACLE_VELOCITY, place, "m/s", still))
        if self.embedded is not None:
            rate = float(self.embedded.transverse_rate)
            found.append(Input(ports.TRANSVERSE_RATE, 1, "1/mean duration", (rate,)))
        return [*found, *self._start_inputs(found)]

    def _start_inputs(self, found: Sequence[Input]) -> list[Input]:
        """What may be told of the start: by default, that it is the mean one, of which there is nothing to remember."""
        if self.field.start_memory is None:
            return []
        start = self.field.start_memory.mean_start
        parts = {found[0].name: start}
        if self.pose is not None:
            joints, pose = start.tensor_split([self.joints])
            position, orientation = self.pose.to_pose(pose)
            parts = {ports.JOINTS: joints, ports.POSITION: position, ports.ORIENTATION: orientation}
        measured = [one for one in found if one.name in parts]
        return [replace(one, name=ports.START + one.name, default=tuple(parts[one.name].tolist())) for one in measured]

    def _outputs(self) -> list[Output]:
        if self.pose is not None:
            joints = [Output(ports.JOINT_VELOCITY, self.joints, "rad/s")] if self.joints else []
            found = [*joints, Output(ports.VELOCITY, 3, "m/s"), Output(ports.OMEGA, 3, "rad/s")]
        elif self.channels == (ports.JOINTS,):
            found = [Output(ports.JOINT_VELOCITY, self.dim, "rad/s")]
        else:
            units = self.inputs[0].unit.split(", ")
            found = [Output(ports.VELOCITY, self.dim, ", ".join(f"{unit}/s" for unit in units))]
        found.append(Output(ports.STATUS, None, "1"))
        if self.has_manifold:
            found.append(Output(ports.OFF_MANIFOLD, None, "m"))
        if self.safe is not None:
            found.append(Output(ports.SAFETY, None, "1"))
        return found


def _embedded(skill: Skill) -> EmbeddedField | None:
    field = skill.field.field
    inner = field.field if isinstance(field, Standing | SafeField) else field
    return inner if isinstance(inner, EmbeddedField) else None


def _decoder(skill: Skill) -> DecoderChart | None:
    chart = skill.field.chart
    return chart.inner if isinstance(chart, ComposedChart) and isinstance(chart.inner, DecoderChart) else None
