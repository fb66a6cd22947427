"""What a vector field and a chart are, and the field that a chart carries to the robot's coordinates."""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import torch
from torch import nn

from geomotion.dynamics.start_memory import CarriedOffset, StartMemory, faded
from geomotion.dynamics.time_law import Clock, ConditionalTimeLaw, LaterTimeLaw, TimeLaw
from geomotion.types import Float, Latent, State, Tensor, Trajectories, Velocity

HELD = 0.5  # of the duration, where a path has ended and a motion may not have

PushForward = Callable[[Tensor], Tensor]


@runtime_checkable
class VectorField(Protocol):
    """An autonomous system ẋ = f(x)."""

    dim: int

    def __call__(self, x: State) -> Velocity:
        """Velocity at each state."""
        ...


@runtime_checkable
class SolvableField(VectorField, Protocol):
    """A field whose trajectories are known in closed form."""

    def solve(self, start: State, times: Float[Tensor, "*#batch time"]) -> Trajectories:
        """States at the given times after the start, which may be the same for all or each one's own."""
        ...


def has_closed_form(field: VectorField) -> bool:
    """Whether trajectories of a field are known in closed form.

    One that wraps another has `solve` whether or not the inner one does, and says so by ``is_solvable``.
    """
    return bool(getattr(field, "is_solvable", isinstance(field, SolvableField)))


@runtime_checkable
class Plan(SolvableField, Protocol):
    """What knows trajectories, but no velocities of states: a call is refused.

    Attributes:
        is_plan: Says so.
    """

    is_plan: bool


@runtime_checkable
class SkillField(VectorField, Protocol):
    """A field whose first coordinates are those of a skill; all others, z_e, lead back to where they vanish.

    Attributes:
        skill_dim: Coordinates of the skill.
    """

    skill_dim: int


@runtime_checkable
class SolvableSkillField(SkillField, Protocol):
    """One whose trajectories are known in closed form."""

    def solve(
        self,
        start: State,
        times: Float[Tensor, "*#batch time"],
        transverse_times: Float[Tensor, "*#batch time"] | None = None,
    ) -> Trajectories:
        """As of :class:`SolvableField`, with a clock of their own for z_e."""
        ...


@runtime_checkable
class TimedVelocity(VectorField, Protocol):
    """A field ẋ = f(x, t)."""

    def velocity(self, x: State, elapsed_s: Float[Tensor, "*#batch 1"]) -> Velocity:
        """Velocity at each state and time since the start of the motion [s]."""
        ...


@runtime_checkable
class Chart(Protocol):
    """A diffeomorphism between the coordinates of the robot (x) and those where contraction is claimed (z).

    An injective one has fewer coordinates z than the robot: ψ⁻¹ reaches a manifold, and ψ projects onto it.

    Attributes:
        dim: Coordinates of the robot.
    """

    dim: int

    def to_latent(self, x: State) -> Latent:
        """z = ψ(x)."""
        ...

    def to_ambient(self, z: Latent) -> State:
        """x = ψ⁻¹(z)."""
        ...

    def linearise(self, x: State) -> tuple[Latent, PushForward]:
        """ψ(x) together with ż ↦ Dψ(x)⁻¹ ż, which reuses the pass that computed ψ(x)."""
        ...


class ChartedField(nn.Module):
    r"""A latent field in the robot's coordinates.

    .. math:: \dot x = \dot\theta(t)\, D\psi(x)^{-1} f(\psi(x)) / T

    Contraction of `field` in the Euclidean metric of z at rate τ is contraction of this field in
    M(x) = Dψ(x)ᵀ Dψ(x) at rate θ̇(t) τ / T.

    Args:
        chart: ψ, from [m] to latent coordinates [-].
        field: f, in latent coordinates per time unit.
        time_unit_s: T, what one unit of the latent field's time lasts [s].
        time_law: θ, which may depend on the condition that states carry; without one, θ̇ = 1.
        transverse_law: The clock of the coordinates beyond those of the skill, where `field` is an embedded one; None:
            θ is theirs as well.
        start_memory: What :meth:`begun` makes of starts; None: they are states like any other.
        carried: c(t) of motions whose starts are known, for which ẋ = f(x - c, t) + ċ; None: of none.
    """

    def __init__(
        self,
        chart: Chart,
        field: VectorField,
        time_unit_s: float,
        time_law: TimeLaw | ConditionalTimeLaw | None = None,
        transverse_law: TimeLaw | None = None,
        start_memory: StartMemory | None = None,
        carried: CarriedOffset | None = None,
    ) -> None:
        super().__init__()
        self.chart = chart
        self.field = field
        self.time_unit_s = time_unit_s
        self.time_law = time_law
        self.transverse_law = transverse_law
        self.start_memory = start_memory
        self.carried = carried
        self.dim = chart.dim

    def forward(self, x: State, elapsed_s: Float[Tensor, "*#batch 1"] | None = None) -> Velocity:
        """ẋ at a time since the start of the motion [s]; without one, at θ̇ = 1 and of no start."""
        if self.carried is not None and elapsed_s is not None:
            x = x - self.carried.at(elapsed_s)
        z, push_forward = self.chart.linearise(x)
        latent = self.field(z)
        if elapsed_s is not None:
            latent = self.paced(latent, elapsed_s / self.time_unit_s, self.law_at(z))
        velocity: Velocity = push_forward(latent) / self.time_unit_s
        if self.carried is not None and elapsed_s is not None:
            velocity = velocity + self.carried.velocity(elapsed_s)
        return velocity

    def velocity(self, x: State, elapsed_s: Float[Tensor, "*#batch 1"]) -> Velocity:
        """ẋ at a time since the start of the motion [s]; what is carried along counts in motions that are begun."""
        velocity: Velocity = self(x, elapsed_s)
        return velocity

    def paced(self, latent: Velocity, times: Float[Tensor, "*#batch 1"], law: TimeLaw) -> Velocity:
        """Latent velocities at times since the start of the motion.

        Args:
            latent: As :attr:`field` gives them.
            times: In units of T.
            law: θ, of :meth:`law_at`.
        """
        speed = law.speed(times)
        if self.transverse_law is None:
            return speed * latent
        assert isinstance(self.field, SkillField)
        along, across = latent.tensor_split([self.field.skill_dim], dim=-1)
        return torch.cat([speed * along, self.transverse_law.speed(times) * across], dim=-1)

    def flow(
        self,
        z: State,
        times: Float[Tensor, "*#batch time"],
        law: TimeLaw,
        begin: Float[Tensor, "*#batch"] | None = None,
    ) -> Trajectories:
        """Latent trajectories, only where they are known in closed form.

        Args:
            z: Where they are at `begin`.
            times: When they are wanted, in units of T since the start of the motion.
            law: θ, of :meth:`law_at`.
            begin: In units of T; None: the start of the motion.
        """
        assert isinstance(self.field, SolvableField)

        def shown(clock: TimeLaw) -> Tensor:
            return clock.progress(times) - (0 if begin is None else clock.progress(begin)[..., None])

        if self.transverse_law is None:
            return self.field.solve(z, shown(law))
        assert isinstance(self.field, SolvableSkillField)
        return self.field.solve(z, shown(law), shown(self.transverse_law))

    def law_at(self, z: State) -> TimeLaw:
        """θ, in units of T; where it depends on the condition, of those that the latent states carry."""
        if isinstance(self.time_law, ConditionalTimeLaw):
            return self.time_law.given(z[..., -self.time_law.context :])
        return Clock() if self.time_law is None else self.time_law

    @property
    def slowest(self) -> float:
        """A lower bound of θ̇."""
        return 1.0 if self.time_law is None else self.time_law.slowest()

    def begun(self, starts: State) -> "ChartedField":
        """The field of motions from these starts, which have a memory of them if :attr:`start_memory` says so."""
        if self.start_memory is None or self.carried is not None:
            return self
        clocks = self.time_unit_s, self.time_law, self.transverse_law
        carried = self.start_memory.carried(starts)
        return ChartedField(self.chart, self.field, *clocks, carried=carried).train(self.training)

    @torch.no_grad()
    def begin_on_skill(self) -> None:
        """Move the mean start to where z_e vanishes: then only what disturbs a motion is beside the skill."""
        assert self.start_memory is not None
        self.start_memory.mean_start.copy_(self._on_skill(self.start_memory.mean_start))

    @torch.no_grad()
    def carry_to(self, path: Float[Tensor, "point D"]) -> None:
        """Let the motion from the mean start be a path that begins there, given at equal times over the mean duration.

        What the motion on the skill lacks of it is carried along. Where the path ends, the motion may still be on its
        way to the goal; what is left fades over `HELD` of the duration more.
        """
        memory = self.start_memory
        assert memory is not None
        held = path[-1:].expand(round(HELD * (len(path) - 1)), -1)
        times = torch.arange(len(path) + len(held), dtype=path.dtype) * (self.time_unit_s / (len(path) - 1))
        motion = self.forgetful().solve(self._on_skill(memory.mean_start), times)
        left = faded((times - self.time_unit_s) / (times[-1] - self.time_unit_s))[:, None]
        memory.carry(left * (torch.cat([path, held]) - motion), float(times[-1]))

    def _on_skill(self, x: State) -> State:
        """The state with the same skill coordinates on the manifold where all others vanish."""
        assert isinstance(self.field, SkillField)
        z = self.chart.to_latent(x).clone()
        z[..., self.field.skill_dim :] = 0
        return self.chart.to_ambient(z)

    def forgetful(self) -> "ChartedField":
        """The same field without a memory of starts."""
        if self.start_memory is None and self.carried is None:
            return self
        clocks = self.time_unit_s, self.time_law, self.transverse_law
        return ChartedField(self.chart, self.field, *clocks).train(self.training)

    def later(self, begin_s: float) -> "ChartedField":
        """The same field for a motion that has run for some time already [s]; what is carried along, if begun."""
        if self.time_law is None:
            return self
        assert isinstance(self.time_law, TimeLaw)  # of one condition
        begin = begin_s / self.time_unit_s
        transverse = None if self.transverse_law is None else LaterTimeLaw(self.transverse_law, begin)
        law = LaterTimeLaw(self.time_law, begin)
        carried = None if self.carried is None else self.carried.later(begin_s)
        clocks = self.time_unit_s, law, transverse
        return ChartedField(self.chart, self.field, *clocks, carried=carried).train(self.training)

    @property
    def is_onto(self) -> bool:
        """Whether ψ⁻¹ reaches every state; otherwise the latent field moves on a manifold of fewer dimensions."""
        return self.field.dim == self.dim

    @property
    def is_solvable(self) -> bool:
        """Whether trajectories are known in closed form."""
        return has_closed_form(self.field) and self.is_onto

    def solve(self, start: State, times: Float[Tensor, "*#batch time"]) -> Trajectories:
        """ψ⁻¹ of the latent trajectory, at times after the start [s]; only where :attr:`is_solvable`."""
        if self.carried is not None:
            start = start - self.carried.at(times.new_zeros(1))
        z, passed = self.chart.to_latent(start), times / self.time_unit_s
        if isinstance(self.time_law, ConditionalTimeLaw):
            passed = passed.expand(*z.shape[:-1], -1)  # each start has a law of its own
        states = self.chart.to_ambient(self.flow(z, passed, self.law_at(z)))
        return states if self.carried is None else states + self.carried.along(times)


class TimedField(nn.Module):
    """A field that changes with time and its clock as one autonomous field: the last coordinate is the time [s].

    Args:
        field: What has ``velocity(x, elapsed_s)``.
    """

    def __init__(self, field: TimedVelocity) -> None:
        super().__init__()
        self.field = field
        self.dim = field.dim + 1

    def forward(self, state: State) -> Velocity:
        time = state[..., -1:]
        return torch.cat([self.field.velocity(state[..., :-1], time), torch.ones_like(time)], dim=-1)
