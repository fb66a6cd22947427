"""How monotonic rational-quadratic splines change with their argument and with their parameters at once.

zuko has the splines; their derivative is written out here because forward differentiation of their many small steps
takes ten times as long, and cannot be exported.

Source: Durkan et al. (2019), Eq. (4), differentiated.
"""

import math
from dataclasses import dataclass

import torch
from torch.nn.functional import pad
from zuko.transforms import MonotonicRQSTransform

from geomotion.types import Float, Tensor

SMALLEST_SLOPE = 1e-3  # of a bin

Parameters = Float[Tensor, "*batch axis parameter"]
Values = Float[Tensor, "*batch axis"]


def splines(parameters: Parameters, bins: int, bound: float) -> MonotonicRQSTransform:
    """One spline for each axis, from widths and heights of its bins and slopes at the knots between them.

    Args:
        parameters: Free numbers, 3 K - 1 for each axis; all zero for the identity.
        bins: K.
        bound: The splines are the identity outside of (-bound, bound).
    """
    return MonotonicRQSTransform(*_parts(parameters, bins), bound=bound, slope=SMALLEST_SLOPE)


def carried(
    parameters: Parameters, parameter_rates: Parameters, x: Values, rates: Values, bins: int, bound: float
) -> tuple[Values, Values]:
    """Values of :func:`splines`, and their rates where parameters and arguments have these rates."""
    spline = splines(parameters, bins, bound)
    widths, heights, slopes = _parts(parameters, bins)
    width_rates, height_rates, slope_rates = _parts(parameter_rates, bins)
    cap = -math.log(SMALLEST_SLOPE)  # of the logarithms of slopes, which zuko squashes smoothly; of others half of it
    horizontal_rates = _knot_rates(spline.horizontal, _squashed_rates(widths, width_rates, cap / 2))
    vertical_rates = _knot_rates(spline.vertical, _squashed_rates(heights, height_rates, cap / 2))
    log_slope_rates = pad(_squashed_rates(slopes, slope_rates, cap), (1, 1))

    last = spline.bins - 1
    index = (x[..., None] >= spline.horizontal).sum(dim=-1, keepdim=True) - 1
    inside = (index >= 0) & (index <= last)
    chosen = _Bin.at(index.clamp(0, last), spline.horizontal, spline.vertical, spline.derivatives)
    rate = _Bin.at(index.clamp(0, last), horizontal_rates, vertical_rates, spline.derivatives * log_slope_rates)
    y, y_rates = _carried_in_bin(chosen, rate, torch.where(inside[..., 0], x, chosen.x), rates)
    return torch.where(inside[..., 0], y, x), torch.where(inside[..., 0], y_rates, rates)


@dataclass(frozen=True)
class _Bin:
    """Where a bin begins, how long and how high it is, and the slopes at both ends; or the rates of all these."""

    x: Values
    y: Values
    width: Values
    height: Values
    first_slope: Values
    last_slope: Values

    @classmethod
    def at(cls, index: Tensor, horizontal: Tensor, vertical: Tensor, slopes: Tensor) -> "_Bin":
        def ends(knots: Tensor) -> tuple[Tensor, Tensor]:
            return knots.gather(-1, index)[..., 0], knots.gather(-1, index + 1)[..., 0]

        (x, next_x), (y, next_y) = ends(horizontal), ends(vertical)
        return cls(x, y, next_x - x, next_y - y, *ends(slopes))


def _carried_in_bin(one: _Bin, rate: _Bin, x: Values, x_rate: Values) -> tuple[Values, Values]:
    mean = one.height / one.width
    mean_rate = (rate.height - mean * rate.width) / one.width
    share = (x - one.x) / one.width
    share_rate = (x_rate - rate.x - share * rate.width) / one.width
    both, both_rate = share * (1 - share), (1 - 2 * share) * share_rate
    bend = one.first_slope + one.last_slope - 2 * mean
    bend_rate = rate.first_slope + rate.last_slope - 2 * mean_rate
    above = mean * share.square() + one.first_slope * both
    above_rate = mean_rate * share.square() + 2 * mean * share * share_rate
    above_rate = above_rate + rate.first_slope * both + one.first_slope * both_rate
    below = mean + bend * both
    below_rate = mean_rate + bend_rate * both + bend * both_rate
    risen = above / below
    return (
        one.y + one.height * risen,
        rate.y + rate.height * risen + one.height * (above_rate - risen * below_rate) / below,
    )


def _parts(parameters: Parameters, bins: int) -> tuple[Tensor, ...]:
    return torch.split(parameters, [bins, bins, bins - 1], dim=-1)


def _squashed_rates(values: Tensor, rates: Tensor, cap: float) -> Tensor:
    """Rates of v / (1 + |v| / cap)."""
    return rates / (1 + values.abs() / cap).square()


def _knot_rates(knots: Tensor, log_rates: Tensor) -> Tensor:
    """Of knots whose distances are a multiple of a softmax, from the rates of its arguments."""
    distances = knots.diff(dim=-1)
    mean = (distances * log_rates).sum(dim=-1, keepdim=True) / distances.sum(dim=-1, keepdim=True)
    return pad((distances * (log_rates - mean)).cumsum(dim=-1), (1, 0))
