"""What a vector field and a chart are, and the field that a chart carries to the robot's coordinates."""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

from torch import nn

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

    .. math:: \dot x = D\psi(x)^{-1} f(\psi(x)) / T

    Contraction of `field` in the Euclidean metric of z at rate τ is contraction of this field in
    M(x) = Dψ(x)ᵀ Dψ(x) at rate τ / T.

    Args:
        chart: ψ, from [m] to latent coordinates [-].
        field: f, in latent coordinates per time unit.
        time_unit_s: T, what one unit of the latent field's time lasts [s].
    """

    def __init__(self, chart: Chart, field: VectorField, time_unit_s: float) -> None:
        super().__init__()
        self.chart = chart
        self.field = field
        self.time_unit_s = time_unit_s
        self.dim = chart.dim

    def forward(self, x: State) -> Velocity:
        z, push_forward = self.chart.linearise(x)
        return push_forward(self.field(z)) / self.time_unit_s

    @property
    def is_solvable(self) -> bool:
        """Whether trajectories are known in closed form."""
        return isinstance(self.field, SolvableField)

    def solve(self, start: State, times: Float[Tensor, "*#batch time"]) -> Trajectories:
        """ψ⁻¹ of the latent trajectory, at times after the start [s]; only where the latent field has one."""
        assert isinstance(self.field, SolvableField)
        return self.chart.to_ambient(self.field.solve(self.chart.to_latent(start), times / self.time_unit_s))
