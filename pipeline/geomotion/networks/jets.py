"""Perceptrons with their first two derivatives, enclosed over boxes of inputs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import torch
from torch import nn

from geomotion.dynamics.balls import ROUND_OFF, Ball, linear
from geomotion.networks.mlp import MLP
from geomotion.types import Float, Int, Tensor

FUNCTION_ERROR = 16 * ROUND_OFF  # of tanh, sigmoid and polynomials in them, whose values are at most about one
BOUNDED = frozenset({"Tanh", "Sigmoid", "Softplus"})  # activations that :func:`activation` knows
INFLECTION = 3**-0.5  # where tanh'' is extreme, as a value of tanh

Radii = Float[Tensor, "*batch D"]


@dataclass(frozen=True)
class Jet:
    """A function of D variables and its derivatives.

    Attributes:
        value: Shape (\\*batch, output).
        first: By each variable, shape (\\*batch, D, output).
        second: By each pair of variables, in the order of ``torch.triu_indices``, shape (\\*batch, pair, output).
    """

    value: Ball
    first: Ball
    second: Ball

    @classmethod
    def variables(cls, x: Ball) -> "Jet":
        """The variables themselves."""
        *batch, dim = x.mid.shape
        eye = torch.eye(dim, dtype=x.mid.dtype).expand(*batch, dim, dim)
        flat = torch.zeros(*batch, dim * (dim + 1) // 2, dim, dtype=x.mid.dtype)
        return cls(x, Ball.exact(eye), Ball.exact(flat))

    def mapped(self, function: Callable[[Ball], Ball]) -> "Jet":
        """After a linear map of the outputs."""
        return Jet(function(self.value), function(self.first), function(self.second))

    def __add__(self, other: "Jet") -> "Jet":
        return Jet(self.value + other.value, self.first + other.first, self.second + other.second)

    def __neg__(self) -> "Jet":
        return self.mapped(Ball.__neg__)

    def through(self, layer: nn.Module) -> "Jet":
        """After a linear layer or an activation."""
        if isinstance(layer, nn.Linear):
            image = self.mapped(lambda part: linear(layer.weight, part))
            return replace(image, value=image.value + Ball.exact(layer.bias))
        value, slope, curvature = activation(layer, self.value)
        return self.composed(value, slope, curvature)

    def composed(self, value: Ball, slope: Ball, curvature: Ball) -> "Jet":
        """Behind functions of one variable, given by their values and derivatives at the values of this jet."""
        rows, columns = torch.triu_indices(*self.first.mid.shape[-2:-1] * 2)
        products = self.first[..., rows, :] * self.first[..., columns, :]
        slope, curvature = slope[..., None, :], curvature[..., None, :]
        return Jet(value, slope * self.first, curvature * products + slope * self.second)

    def sharpened(self, centre: "Jet", radii: Radii) -> "Jet":
        """Tighter value and first derivatives over a box, by the mean value theorem from its centre.

        Args:
            centre: The same function at the centre of the box.
            radii: Half the sides of the box.
        """
        curvatures = self.second.magnitude[..., pair_numbers(radii.shape[-1]), :]
        value = (self.first.magnitude * radii[..., None]).sum(-2)
        first = (curvatures * radii[..., None, :, None]).sum(-2)
        return Jet(
            self.value.tightest(centre.value.enlarged(value)),
            self.first.tightest(centre.first.enlarged(first)),
            self.second,
        )


def enclose(network: MLP, centre: Ball, radii: Radii) -> tuple[Jet, Jet]:
    """The network at the centres of boxes, and over the boxes.

    Args:
        network: In double precision.
        centre: Centres, shape (\\*batch, D).
        radii: Half the sides of the boxes.
    """
    point, box = Jet.variables(centre), Jet.variables(centre.enlarged(radii))
    for layer in network:
        point, box = point.through(layer), box.through(layer)
        if isinstance(layer, nn.Linear):
            box = box.sharpened(point, radii)
    return point, box


def pair_numbers(dim: int) -> Int[Tensor, "D D"]:
    """Number of the pair of two variables, whatever their order."""
    rows, columns = torch.triu_indices(dim, dim)
    numbers = torch.zeros(dim, dim, dtype=torch.long)
    numbers[rows, columns] = numbers[columns, rows] = torch.arange(len(rows))
    return numbers


def activation(layer: nn.Module, x: Ball) -> tuple[Ball, Ball, Ball]:
    """σ, σ' and σ'' of a smooth activation; both derivatives are polynomials in tanh or the logistic function.

    Raises:
        TypeError: If no enclosure of this activation is known.
    """
    match layer:
        case nn.Tanh():
            ends = _monotone(torch.tanh, x)
            first = _range(lambda t: 1 - t * t, (0.0,), *ends)
            second = _range(lambda t: 2 * t * (t * t - 1), (-INFLECTION, INFLECTION), *ends)
            return Ball.between(*ends), first, second
        case nn.Sigmoid():
            ends = _monotone(torch.sigmoid, x)
            turns = (1 - INFLECTION) / 2, (1 + INFLECTION) / 2
            first = _range(lambda s: s * (1 - s), (0.5,), *ends)
            return Ball.between(*ends), first, _range(lambda s: s * (1 - s) * (1 - 2 * s), turns, *ends)
        case nn.Softplus(beta=1):
            logistic = _monotone(torch.sigmoid, x)
            second = _range(lambda s: s * (1 - s), (0.5,), *logistic)
            return Ball.between(*_monotone(_softplus, x)), Ball.between(*logistic), second
        case unknown:
            raise TypeError(f"no enclosure of {type(unknown).__name__}")


def _softplus(x: Tensor) -> Tensor:
    return torch.logaddexp(x, torch.zeros_like(x))


def _monotone(function: Callable[[Tensor], Tensor], x: Ball) -> tuple[Tensor, Tensor]:
    """Bounds on an increasing function that varies no faster than its argument."""
    lower, upper = function(x.mid - x.radius), function(x.mid + x.radius)
    return lower - FUNCTION_ERROR * (1 + lower.abs()), upper + FUNCTION_ERROR * (1 + upper.abs())


def _range(function: Callable[[Tensor], Tensor], turns: Sequence[float], lower: Tensor, upper: Tensor) -> Ball:
    """Bounds on a function over intervals, given all places where it turns."""
    inside = [torch.full_like(lower, turn).clamp(lower, upper) for turn in turns]
    values = torch.stack([function(place) for place in (lower, upper, *inside)])
    return Ball.between(values.amin(0), values.amax(0)).enlarged(FUNCTION_ERROR * torch.ones_like(lower))
