"""How fast a motion runs at each time after its start: the same path, another time law (thesis Ch. 5 has none)."""

import math
from typing import Protocol, runtime_checkable

import torch
from torch import nn

from geomotion.dynamics.knots import speeds_at_knots, spline_progress, spline_speed
from geomotion.types import Float, Tensor

RAW_SPEED_ONE = math.log(math.expm1(1.0))  # softplus of it is one


@runtime_checkable
class TimeLaw(Protocol):
    """Progress θ of a motion as an increasing function of the time since its start, both in mean durations."""

    def speed(self, times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """θ̇ > 0 at times after the start."""
        ...

    def progress(self, times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """θ at times after the start, 0 at the start."""
        ...

    def slowest(self) -> float:
        """A lower bound of θ̇."""
        ...


class Clock:
    """θ(t) = t: the time law of a field that has none."""

    def slowest(self) -> float:
        """One."""
        return 1.0

    def speed(self, times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """One."""
        return torch.ones_like(times)

    def progress(self, times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """The time itself."""
        return times


class KnotTimeLaw(nn.Module):
    """A time law from its speeds at knots, wherever these come from."""

    def at_knots(self) -> Float[Tensor, "*group knot"]:
        """θ̇ at the knots: one law for all times, or one for each group of them, which their first axes tell apart."""
        raise NotImplementedError

    def slowest(self) -> float:
        """The smallest θ̇, which a knot has."""
        return float(self.at_knots().detach().min())

    def speed(self, times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """θ̇ at times after the start."""
        return spline_speed(self.at_knots(), times)

    def progress(self, times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """θ at times after the start."""
        return spline_progress(self.at_knots(), times)


class SplineTimeLaw(KnotTimeLaw):
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
        self.raw_speeds = nn.Parameter(torch.full((knots + 1,), RAW_SPEED_ONE))

    def at_knots(self) -> Float[Tensor, " knot"]:
        return speeds_at_knots(self.raw_speeds, self.min_speed)


class ConditionalTimeLaw(nn.Module):
    """Time laws of conditions: the parameters of a :class:`SplineTimeLaw`, linear in the code c of the condition.

    Args:
        context: K, entries of c, which add up to one.
        knots: Intervals between knots.
        min_speed: Smallest θ̇, under every condition.
    """

    def __init__(self, context: int, knots: int, min_speed: float) -> None:
        super().__init__()
        self.context = context
        self.min_speed = min_speed
        self.raw_speeds = nn.Parameter(torch.full((context, knots + 1), RAW_SPEED_ONE))

    def slowest(self) -> float:
        """A lower bound of θ̇ that holds for every condition."""
        return self.min_speed

    def given(self, condition: Float[Tensor, "*group K"]) -> "GivenTimeLaw":
        """The law of one condition, or of one for each group of times."""
        return GivenTimeLaw(speeds_at_knots(condition @ self.raw_speeds, self.min_speed))


class GivenTimeLaw(KnotTimeLaw):
    """A time law from its speeds at the knots.

    Args:
        speeds: θ̇ at the knots, one law for all times or one for each group of them, which their first axes tell apart.
    """

    speeds: Tensor

    def __init__(self, speeds: Float[Tensor, "*group knot"]) -> None:
        super().__init__()
        self.register_buffer("speeds", speeds)

    def at_knots(self) -> Float[Tensor, "*group knot"]:
        return self.speeds


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

    def slowest(self) -> float:
        """The bound of the whole law."""
        return self.law.slowest()

    def speed(self, times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """θ̇ after the later start."""
        return self.law.speed(times + self.begin)

    def progress(self, times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """Progress since the later start."""
        return self.law.progress(times + self.begin) - self.law.progress(torch.full_like(times, self.begin))
