r"""Fields that depend on a condition: a conditional system is an autonomous one of (x, c) whose c stands still.

.. math:: \dot x = f(x, c), \qquad \dot c = 0

So charts, fields, rollouts and training objectives serve both, and a fixed condition gives an ordinary field.

Conditions enter as codes whose entries add up to one: what is linear in a code is affine in the condition, and where
each entry belongs to one label it is that label's own.

Source: Thesis Eq. (5.13), Sec. 5.5.
"""

from collections.abc import Callable

import torch
from torch import nn

from geomotion.dynamics.conditional_linear import ConditionalLinear
from geomotion.dynamics.fields import (
    Chart,
    ChartedField,
    PushForward,
    SkillField,
    SolvableField,
    SolvableSkillField,
    VectorField,
    has_closed_form,
)
from geomotion.dynamics.line_integral import LineIntegralField
from geomotion.dynamics.regularisers import Regulariser, StateDependentRegulariser
from geomotion.dynamics.time_law import ConditionalTimeLaw
from geomotion.types import Float, State, Tensor, Trajectories, Velocity


class Standing(nn.Module):
    """(z, c) ↦ (f(z), 0): a field in the first coordinates, beside others that stand still.

    Args:
        field: f.
        context: Number of coordinates that stand still.

    Attributes:
        skill_dim: Coordinates of the skill, of an embedded field alone.
    """

    skill_dim: int

    def __init__(self, field: VectorField, context: int) -> None:
        super().__init__()
        self.field = field
        self.context = context
        self.dim = field.dim + context
        if isinstance(field, SkillField):
            self.skill_dim = field.skill_dim

    @property
    def is_solvable(self) -> bool:
        """Whether f has trajectories in closed form."""
        return has_closed_form(self.field)

    def given(self, condition: Float[Tensor, " K"]) -> VectorField:
        """f, the same for every condition."""
        return self.field

    def forward(self, x: State) -> Velocity:
        z, condition = x[..., : -self.context], x[..., -self.context :]
        return torch.cat([self.field(z), torch.zeros_like(condition)], -1)

    def solve(
        self,
        start: State,
        times: Float[Tensor, "*#batch time"],
        transverse_times: Float[Tensor, "*#batch time"] | None = None,
    ) -> Trajectories:
        """Trajectories; only where the field has them in closed form, and a clock for z_e where it has z_e."""
        z, condition = start[..., : -self.context], start[..., -self.context :]
        if transverse_times is None:
            assert isinstance(self.field, SolvableField)
            moving = self.field.solve(z, times)
        else:
            assert isinstance(self.field, SolvableSkillField)
            moving = self.field.solve(z, times, transverse_times)
        return torch.cat([moving, condition[..., None, :].expand(*moving.shape[:-1], -1)], -1)


class ConditionalLineIntegral(nn.Module):
    r"""The thesis' field with a condition, as a field of (x, c).

    .. math:: \hat J(x, c) = -(J_\theta(x, c)^\top J_\theta(x, c) + \operatorname{diag} \varepsilon(x, c)) + S(x, c)

    Base point and base velocity are the same for all conditions.

    Args:
        field: The field, of whose networks all take (x, c).
        context: Number of entries of c.

    Source: Thesis Eq. (5.13).
    """

    def __init__(self, field: LineIntegralField, context: int) -> None:
        super().__init__()
        self.field = field
        self.context = context
        self.dim = field.dim + context

    def given(self, condition: Float[Tensor, "*batch K"]) -> LineIntegralField:
        """The field of one condition, or of one for each of a batch of states."""
        field = self.field
        return LineIntegralField(
            Given(field.jacobian_root, condition),
            _given_regulariser(field.regulariser, condition),
            field.base_point,
            field.base_velocity,
            field.integrator,
            None if field.skew_part is None else Given(field.skew_part, condition),
        )

    def forward(self, x: State) -> Velocity:
        z, condition = x[..., : -self.context], x[..., -self.context :]
        return torch.cat([self.given(condition)(z), torch.zeros_like(condition)], -1)


class Given(nn.Module):
    """x ↦ g(x, c) for a fixed c.

    Args:
        function: g, of states and conditions side by side.
        condition: c, one for all states or one for each of a batch, whose states may have further axes.
    """

    condition: Tensor

    def __init__(self, function: Callable[[Tensor], Tensor], condition: Float[Tensor, "*batch K"]) -> None:
        super().__init__()
        self.function = function
        self.register_buffer("condition", condition)

    def forward(self, x: State) -> Tensor:
        further = x.ndim - self.condition.ndim if self.condition.ndim > 1 else 0
        condition = self.condition[(..., *(None,) * further, slice(None))]
        return self.function(torch.cat([x, condition.expand(*x.shape[:-1], -1)], -1))


def _given_regulariser(regulariser: Regulariser, condition: Float[Tensor, "*batch K"]) -> Regulariser:
    if not isinstance(regulariser, StateDependentRegulariser):
        return regulariser
    root = Given(regulariser.epsilon_root, condition)
    return StateDependentRegulariser(root, regulariser.spread_weight, regulariser.spread_limit)


class ChartGiven(nn.Module):
    """x ↦ ψ((x - s) / r, c) for a fixed condition.

    Args:
        chart: ψ, a chart of (x, c) that leaves c as it is.
        condition: c, shape (K,).
        shift: s, where the origin of the chart's states is moved to [m].
        stretch: r, by which lengths are larger than the chart's.
    """

    condition: Tensor
    shift: Tensor
    stretch: Tensor
    latent_condition: Tensor

    def __init__(
        self, chart: Chart, condition: Float[Tensor, " K"], shift: Float[Tensor, " D"], stretch: float = 1.0
    ) -> None:
        super().__init__()
        self.chart = chart
        self.dim = chart.dim - len(condition)
        self.register_buffer("condition", condition)
        self.register_buffer("shift", shift)
        self.register_buffer("stretch", torch.as_tensor(stretch, dtype=shift.dtype))
        self.register_buffer("latent_condition", self._latent_condition(), persistent=False)

    def to_latent(self, x: State) -> State:
        return self.chart.to_latent(self._own_frame(x))[..., : self.dim]

    def to_ambient(self, z: State) -> State:
        own = self.chart.to_ambient(self._beside(z, self.latent_condition))[..., : self.dim]
        return own * self.stretch + self.shift

    def linearise(self, x: State) -> tuple[State, PushForward]:
        z, push_forward = self.chart.linearise(self._own_frame(x))

        def push(tangent: Tensor) -> Tensor:
            own = push_forward(self._beside(tangent, torch.zeros_like(self.condition)))[..., : self.dim]
            return own * self.stretch

        return z[..., : self.dim], push

    def _own_frame(self, x: State) -> Tensor:
        return self._beside((x - self.shift) / self.stretch, self.condition)

    def _beside(self, x: State, condition: Float[Tensor, " K"]) -> Tensor:
        return torch.cat([x, condition.expand(*x.shape[:-1], -1)], -1)

    @torch.no_grad()
    def _latent_condition(self) -> Float[Tensor, " K"]:
        """What the chart makes of c: at most another unit."""
        origin = torch.cat([torch.zeros_like(self.shift), self.condition])
        return self.chart.to_latent(origin)[self.dim :]


@torch.no_grad()
def given(
    field: ChartedField,
    condition: Float[Tensor, " K"],
    shift: Float[Tensor, " D"],
    stretch: float = 1.0,
    slowdown: float = 1.0,
) -> ChartedField:
    """The ordinary field that a field of (x, c) is for a fixed condition.

    Args:
        field: Of states and conditions; its latent field has :class:`Standing`, :class:`ConditionalLinear` or
            :class:`ConditionalLineIntegral`.
        condition: c, as the field takes it.
        shift: Where the origin of the field's states is moved to [m].
        stretch: By which lengths are larger than the field's.
        slowdown: By which times are longer than the field's.
    """
    chart, latent, law = ChartGiven(field.chart, condition, shift, stretch), field.field, field.time_law
    assert isinstance(latent, Standing | ConditionalLinear | ConditionalLineIntegral)
    if isinstance(law, ConditionalTimeLaw):
        law = law.given(chart.latent_condition)
    within = latent.given(chart.latent_condition)
    return ChartedField(chart, within, slowdown * field.time_unit_s, law, field.transverse_law)
