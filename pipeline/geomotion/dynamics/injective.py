r"""A skill on a manifold: decoded from few coordinates, and what becomes of states beside the manifold.

A bijection ι of all D coordinates gives an injective decoder of d < D of them by padding with zeros, and an encoder by
dropping the others:

.. math:: \mu(z) = \iota(z, 0), \qquad \mu^{\sim 1}(x) = \operatorname{Unpad}(\iota^{-1}(x))

Velocities are decoded where the code is, ẋ = J_μ(z) ż, whatever was dropped: a state beside the manifold moves as its
projection does, and nothing brings it back. Either it is projected first, or it is led there in a transition.

Source: Thesis Eq. (6.1)-(6.3), Algorithm 2, Sec. 6.4.2.
"""

from typing import Any, Protocol

import torch
from torch import nn

from geomotion.dynamics.charts import ComposedChart, ScalingChart
from geomotion.dynamics.fields import Chart, ChartedField, PushForward
from geomotion.dynamics.rollout import Box, Rollout, judge, rollout
from geomotion.types import Float, Latent, State, Tensor, Times, Velocity


class Bijection(Chart, Protocol):
    """A chart ι⁻¹ of all coordinates that can also be linearised at latent points."""

    def carry(self, z: State, tangent: State) -> tuple[State, State]:
        """ι(z) and Dι(z) ż."""
        ...


class DecoderChart(nn.Module):
    """μ as a chart of its manifold, and its approximate inverse.

    Args:
        scaling: From states [m] to the range of the bijection.
        bijection: ι⁻¹, of D coordinates.
        latent_dim: d, how many of its coordinates make up the code; less than D.

    Source: Thesis Eq. (6.1), (6.2).
    """

    def __init__(self, scaling: ScalingChart, bijection: Bijection, latent_dim: int) -> None:
        super().__init__()
        self.scaling = scaling
        self.bijection = bijection
        self.latent_dim = latent_dim
        self.dim = bijection.dim

    def split(self, x: State) -> tuple[Latent, Float[Tensor, "*batch e"]]:
        """Code z_m and offset z_e, which vanishes on the manifold."""
        z = self.bijection.to_latent(self.scaling.to_latent(x))
        return z[..., : self.latent_dim], z[..., self.latent_dim :]

    def join(self, code: Latent, offset: Float[Tensor, "*batch e"]) -> State:
        """The state with this code and this offset."""
        return self.scaling.to_ambient(self.bijection.to_ambient(torch.cat([code, offset], dim=-1)))

    def carry(self, code: Latent, offset: Tensor, code_rate: Latent, offset_rate: Tensor) -> tuple[State, Velocity]:
        """The state with this code and this offset, and its velocity where these have rates."""
        z, rate = torch.cat([code, offset], dim=-1), torch.cat([code_rate, offset_rate], dim=-1)
        x, velocity = self.bijection.carry(z, rate)
        return self.scaling.to_ambient(x), velocity * self.scaling.scale

    def to_latent(self, x: State) -> Latent:
        return self.split(x)[0]

    def to_ambient(self, z: Latent) -> State:
        return self.join(z, self._nothing(z))

    def linearise(self, x: State) -> tuple[Latent, PushForward]:
        """The code and ż ↦ J_μ(z) ż, which is that of the state's projection."""
        code = self.to_latent(x)
        return code, lambda tangent: self.carry(code, self._nothing(code), tangent, self._nothing(tangent))[1]

    def _nothing(self, code: Latent) -> Float[Tensor, "*batch e"]:
        """Zeros beside a code: Pad."""
        return torch.zeros_like(code[..., :1]).expand(*code.shape[:-1], self.dim - self.latent_dim)

    def project(self, x: State) -> State:
        """The state on the manifold with the same code."""
        return self.to_ambient(self.to_latent(x))


def decoded(decoder: DecoderChart, latent: ChartedField) -> ChartedField:
    """The field of states that a field of codes gives, Algorithm 2; both share their parameters."""
    return _with_chart(latent, ComposedChart(decoder, latent.chart))


def _with_chart(field: ChartedField, chart: Chart) -> ChartedField:
    clocks = field.time_unit_s, field.time_law, field.transverse_law
    return ChartedField(chart, field.field, *clocks).train(field.training)


def decoder_of(field: ChartedField) -> DecoderChart:
    """The decoder of a field that :func:`decoded` made."""
    assert isinstance(field.chart, ComposedChart) and isinstance(field.chart.inner, DecoderChart)
    return field.chart.inner


@torch.no_grad()
def rollout_on_manifold(
    field: ChartedField,
    starts: Float[Tensor, "start D"],
    times: Times,
    *,
    goal: Float[Tensor, " D"] | None = None,
    goal_tolerance: float = 1e-3,
    region: Box | None = None,
    **solver: Any,
) -> Rollout:
    """Follow a decoded field from where the encoder projects each start to; states are decoded once, in the end.

    Args:
        field: What :func:`decoded` made.
        starts: States, projected first.
        times: Output times [s], increasing.
        goal: As of :func:`geomotion.dynamics.rollout.rollout`.
        goal_tolerance: As there [m].
        region: As there.
        solver: Its keywords that choose the solver; tolerances are in units of the code.
    """
    assert isinstance(field.chart, ComposedChart)
    decoder = decoder_of(field)
    codes = rollout(_with_chart(field, field.chart.outer), decoder.to_latent(starts), times, **solver)
    states = decoder.to_ambient(codes.states)
    statuses = judge(field, states, times, goal, goal_tolerance, region)
    return Rollout(states, statuses, codes.method, codes.note)


@torch.no_grad()
def transition(
    decoder: DecoderChart, start: Float[Tensor, " D"], shares: Float[Tensor, " time"], duration_s: float
) -> tuple[Float[Tensor, "time D"], Float[Tensor, "time D"]]:
    """Lead a state to its projection: its offset shrinks evenly while its code stands still.

    Args:
        decoder: Whose manifold.
        start: Where it begins [m].
        shares: Of the transition that are done, 0 to 1.
        duration_s: How long all of it takes [s].

    Returns:
        States [m] and velocities [m/s].

    Source: Thesis Sec. 6.4.2.
    """
    code, offset = decoder.split(start)
    codes, offsets = code.expand(len(shares), -1), offset.expand(len(shares), -1)
    remaining = (1 - shares[:, None]) * offsets
    return decoder.carry(codes, remaining, torch.zeros_like(codes), -offsets / duration_s)
