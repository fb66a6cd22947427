"""How fast a motion runs at each time after its start: the same path, another time law (thesis Ch. 5 has none)."""

import math
from typing import Protocol, runtime_checkable

import torch
from torch import nn

from geomotion.types import Float, Tensor


@runtime_checkable
class TimeLaw(Protocol):
    """Progress θ of a motion as an increasing function of the time since its start, both in mean durations."""

    def speed(self, times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """θ̇ > 0 at times after the start."""
        ...

    def progress(self, times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """θ at times after the start, 0 at the start."""
        ...

    @property
    def slowest(self) -> float:
        """A lower bound of θ̇."""
        ...


class SplineTimeLaw(nn.Module):
    r"""A time law that is learned: θ̇ is piecewise linear.

    .. math::
        \dot\theta(t) = m + (1 - m)\, p(t) > 0, \qquad \theta(t) = \int_0^t \dot\theta(s)\, ds, \qquad \theta(1) = 1

    p is positive and linear between knots at equal distances over [0, 1], with mean one there, and constant from 1 on.

    ẋ = θ̇(t) f(x) has the trajectories of ẋ = f(x) at the times θ(t). If f contracts at rate τ, distances in its metric
    fall at least as fast as e^{-τ θ(t)}, whatever the parameters: by e^{-τ} over the first duration, at no time slower
    than at the rate m τ. An autonomous field cannot start from rest where its goal is not; this one can.

    Args:
        knots: Intervals between knots.
        min_speed: m, in (0, 1): the smallest θ̇.
    """

    def __init__(self, knots: int, min_speed: float) -> None:
        super().__init__()
        self.knots = knots
        self.min_speed = min_speed
        self.raw_speeds = nn.Parameter(torch.full((knots + 1,), math.log(math.expm1(1.0))))  # softplus of it is one

    @property
    def speeds(self) -> Float[Tensor, " knot"]:
        """θ̇ at the knots."""
        free = nn.functional.softplus(self.raw_speeds)
        mean = (free.sum() - (free[0] + free[-1]) / 2) / self.knots  # trapezoids, exact for piecewise linear speeds
        return self.min_speed + (1 - self.min_speed) * free / mean

    @property
    def slowest(self) -> float:
        """The smallest θ̇, which a knot has."""
        return float(self.speeds.detach().min())

    def speed(self, times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """θ̇ at times after the start."""
        speeds = self.speeds
        knot, share = self._locate(times)
        return torch.lerp(speeds[knot], speeds[knot + 1], share)

    def progress(self, times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """θ at times after the start."""
        speeds = self.speeds
        knot, share = self._locate(times)
        means = (speeds[1:] + speeds[:-1]) / (2 * self.knots)
        before = torch.cat([means.new_zeros(1), means.cumsum(0)])
        within = share * (speeds[knot] + share * (speeds[knot + 1] - speeds[knot]) / 2) / self.knots
        return before[knot] + within + speeds[-1] * (times - 1).clamp(min=0)

    def _locate(self, times: Tensor) -> tuple[Tensor, Tensor]:
        """The knot before each time, and the share of the way to the next."""
        position = times.clamp(0, 1) * self.knots
        knot = position.long().clamp(max=self.knots - 1)
        return knot, position - knot


class LaterTimeLaw(nn.Module):
    """What is left of a time law after some time: θ(t + s) - θ(s).

    Args:
        law: θ.
        begin: s, in mean durations.
    """

    def __init__(self, law: TimeLaw, begin: float) -> None:
        super().__init__()
        self.law = law
        self.begin = begin

    @property
    def slowest(self) -> float:
        """The bound of the whole law."""
        return self.law.slowest

    def speed(self, times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """θ̇ after the later start."""
        return self.law.speed(times + self.begin)

    def progress(self, times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """Progress since the later start."""
        return self.law.progress(times + self.begin) - self.law.progress(torch.full_like(times, self.begin))
