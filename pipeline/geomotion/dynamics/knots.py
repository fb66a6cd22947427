"""Speeds that are linear between knots at equal distances over [0, 1] and constant afterwards, and their integral."""

import torch
from torch import nn

from geomotion.types import Float, Tensor


def speeds_at_knots(raw_speeds: Float[Tensor, "*batch knot"], min_speed: float) -> Float[Tensor, "*batch knot"]:
    """θ̇ at the knots: above `min_speed`, with mean one over [0, 1]."""
    free = nn.functional.softplus(raw_speeds)
    ends = (free[..., :1] + free[..., -1:]) / 2
    mean = (free.sum(-1, keepdim=True) - ends) / (free.shape[-1] - 1)  # trapezoids, exact for piecewise linear speeds
    return min_speed + (1 - min_speed) * free / mean


def spline_speed(speeds: Float[Tensor, "*group knot"], times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    """θ̇ from its values at the knots, of which each group of times, their first axes, has its own."""
    knot, share = _locate(times, speeds.shape[-1] - 1)
    return torch.lerp(_of_knots(speeds, knot), _of_knots(speeds, knot + 1), share)


def spline_progress(speeds: Float[Tensor, "*group knot"], times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    """θ, the integral of θ̇."""
    knots = speeds.shape[-1] - 1
    knot, share = _locate(times, knots)
    means = (speeds[..., 1:] + speeds[..., :-1]) / (2 * knots)
    before = nn.functional.pad(means.cumsum(-1), (1, 0))
    begin, end, last = _of_knots(speeds, knot), _of_knots(speeds, knot + 1), torch.full_like(knot, knots)
    within = share * (begin + share * (end - begin) / 2) / knots
    return _of_knots(before, knot) + within + _of_knots(speeds, last) * (times - 1).clamp(min=0)


def _locate(times: Tensor, knots: int) -> tuple[Tensor, Tensor]:
    """The knot before each time, and the share of the way to the next."""
    position = times.clamp(0, 1) * knots
    knot = position.long().clamp(max=knots - 1)
    return knot, position - knot


def _of_knots(values: Float[Tensor, "*group knot"], knot: Tensor) -> Tensor:
    """Values at chosen knots."""
    if values.ndim == 1:
        return values[knot]
    chosen: Tensor = values.gather(-1, knot.reshape(*values.shape[:-1], -1)).view(knot.shape)
    return chosen
