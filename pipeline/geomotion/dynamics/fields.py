"""What a vector field and a chart are, and the field that a chart carries to the robot's coordinates."""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import torch
from torch import nn

from geomotion.dynamics.time_law import LaterTimeLaw, TimeLaw
from geomotion.types import Float, State, Tensor, Trajectories, Velocity

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


@runtime_checkable
class TimedVelocity(VectorField, Protocol):
    """A field ẋ = f(x, t)."""

    def velocity(self, x: State, elapsed_s: Float[Tensor, "*#batch 1"]) -> Velocity:
        """Velocity at each state and time since the start of the motion [s]."""
        ...


@runtime_checkable
class Chart(Protocol):
    """A diffeomorphism between the coordinates of the robot (x) and those where contraction is claimed (z)."""

    dim: int

    def to_latent(self, x: State) -> State:
        """z = ψ(x)."""
        ...

    def to_ambient(self, z: State) -> State:
        """x = ψ⁻¹(z)."""
        ...

    def linearise(self, x: State) -> tuple[State, PushForward]:
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
        time_law: θ; without one, θ̇ = 1.
    """

    def __init__(self, chart: Chart, field: VectorField, time_unit_s: float, time_law: TimeLaw | None = None) -> None:
        super().__init__()
        self.chart = chart
        self.field = field
        self.time_unit_s = time_unit_s
        self.time_law = time_law
        self.dim = chart.dim

    def forward(self, x: State, elapsed_s: Float[Tensor, "*#batch 1"] | None = None) -> Velocity:
        """ẋ at a time since the start of the motion [s]; without one, at θ̇ = 1."""
        z, push_forward = self.chart.linearise(x)
        velocity: Velocity = push_forward(self.field(z)) / self.time_unit_s
        return velocity if elapsed_s is None else self.speed(elapsed_s / self.time_unit_s) * velocity

    def velocity(self, x: State, elapsed_s: Float[Tensor, "*#batch 1"]) -> Velocity:
        """ẋ at a time since the start of the motion [s]."""
        velocity: Velocity = self(x, elapsed_s)
        return velocity

    def speed(self, times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """θ̇ at times since the start of the motion, in units of T."""
        return torch.ones_like(times) if self.time_law is None else self.time_law.speed(times)

    def progress(self, times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """θ at times since the start of the motion, both in units of T."""
        return times if self.time_law is None else self.time_law.progress(times)

    @property
    def slowest(self) -> float:
        """A lower bound of θ̇."""
        return 1.0 if self.time_law is None else self.time_law.slowest

    def later(self, begin_s: float) -> "ChartedField":
        """The same field for a motion that has run for some time already [s]."""
        if self.time_law is None:
            return self
        law = LaterTimeLaw(self.time_law, begin_s / self.time_unit_s)
        return ChartedField(self.chart, self.field, self.time_unit_s, law).train(self.training)

    @property
    def is_solvable(self) -> bool:
        """Whether trajectories are known in closed form."""
        return isinstance(self.field, SolvableField)

    def solve(self, start: State, times: Float[Tensor, "*#batch time"]) -> Trajectories:
        """ψ⁻¹ of the latent trajectory, at times after the start [s]; only where the latent field has one."""
        assert isinstance(self.field, SolvableField)
        progress = self.progress(times / self.time_unit_s)
        return self.chart.to_ambient(self.field.solve(self.chart.to_latent(start), progress))


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
