"""Invertible flows of couplings along monotonic rational-quadratic splines.

Of each layer one half of the coordinates stays as it is and decides, through a residual network, along which splines
the other half moves, coordinate by coordinate. Both directions are closed forms. Outside of (-bound, bound) the
splines are the identity, so data have to be scaled into that range.

Source: Durkan et al. (2019); thesis Sec. 6.4.5.
"""

from collections.abc import Iterator

import torch
from torch import nn

from geomotion.dynamics.fields import PushForward
from geomotion.networks.rational_quadratic import carried, splines
from geomotion.types import Float, State, Tensor


class SplineFlow(nn.Module):
    """ι⁻¹ as a chart: a chain of spline couplings whose halves take turns; the identity at the start.

    Args:
        dim: D, at least 2.
        layers: Couplings.
        bins: Of each spline.
        bound: Where splines end.
        blocks: Residual blocks of each network.
        units: Width of these.
    """

    def __init__(self, dim: int, layers: int, bins: int, bound: float, blocks: int, units: int) -> None:
        super().__init__()
        self.dim = dim
        self.couplings = nn.ModuleList(
            SplineCoupling(dim, layer % 2 == 0, bins, bound, blocks, units) for layer in range(layers)
        )

    def to_latent(self, x: State) -> State:
        """ι⁻¹(x)."""
        for coupling in reversed(list(self._each())):
            x = coupling.inverse(x)
        return x

    def to_ambient(self, z: State) -> State:
        """ι(z)."""
        for coupling in self._each():
            z = coupling(z)
        return z

    def carry(self, z: State, tangent: State) -> tuple[State, State]:
        """ι(z) and Dι(z) ż."""
        for coupling in self._each():
            z, tangent = coupling.carry(z, tangent)
        return z, tangent

    def linearise(self, x: State) -> tuple[State, PushForward]:
        """ι⁻¹(x) and ż ↦ Dι(z) ż."""
        z = self.to_latent(x)
        return z, lambda tangent: self.carry(z, tangent)[1]

    def _each(self) -> "Iterator[SplineCoupling]":
        for coupling in self.couplings:
            assert isinstance(coupling, SplineCoupling)
            yield coupling


class SplineCoupling(nn.Module):
    """One layer of a :class:`SplineFlow`, which keeps the first half of the coordinates or the second."""

    def __init__(self, dim: int, keeps_first: bool, bins: int, bound: float, blocks: int, units: int) -> None:
        super().__init__()
        first = (dim + 1) // 2
        self.sizes = [first, dim - first]
        self.keeps_first = keeps_first
        self.bins, self.bound = bins, bound
        self.per_spline = 3 * bins - 1
        kept, moved = self.sizes if keeps_first else reversed(self.sizes)
        self.conditioner = ResidualNetwork(kept, moved * self.per_spline, blocks, units)

    def forward(self, x: State) -> State:
        kept, moved = self._halves(x)
        parameters = self._of_each(self.conditioner(kept))
        return self._whole(kept, splines(parameters, self.bins, self.bound)(moved))

    def inverse(self, y: State) -> State:
        """The state that :meth:`forward` takes to y."""
        kept, moved = self._halves(y)
        parameters = self._of_each(self.conditioner(kept))
        return self._whole(kept, splines(parameters, self.bins, self.bound).inv(moved))

    def carry(self, x: State, tangent: State) -> tuple[State, State]:
        """What :meth:`forward` makes of a state and of a tangent there."""
        (kept, moved), (kept_rate, moved_rate) = self._halves(x), self._halves(tangent)
        parameters, rates = map(self._of_each, self.conditioner.carry(kept, kept_rate))
        moved, moved_rate = carried(parameters, rates, moved, moved_rate, self.bins, self.bound)
        return self._whole(kept, moved), self._whole(kept_rate, moved_rate)

    def _of_each(self, parameters: Float[Tensor, "*batch all"]) -> Float[Tensor, "*batch axis parameter"]:
        each: Tensor = parameters.unflatten(-1, (-1, self.per_spline))  # type: ignore[no-untyped-call]
        return each

    def _halves(self, x: State) -> tuple[Tensor, Tensor]:
        first, second = torch.split(x, self.sizes, dim=-1)
        return (first, second) if self.keeps_first else (second, first)

    def _whole(self, kept: Tensor, moved: Tensor) -> State:
        return torch.cat([kept, moved] if self.keeps_first else [moved, kept], dim=-1)


class ResidualNetwork(nn.Module):
    """A linear layer, blocks that each add what a hidden layer makes, and a linear layer that starts at zero."""

    def __init__(self, inputs: int, outputs: int, blocks: int, units: int) -> None:
        super().__init__()
        self.first = nn.Linear(inputs, units)
        self.hidden = nn.ModuleList(nn.Linear(units, units) for _ in range(2 * blocks))
        self.last = nn.Linear(units, outputs)
        nn.init.zeros_(self.last.weight)
        nn.init.zeros_(self.last.bias)

    def forward(self, x: Float[Tensor, "*batch inputs"]) -> Float[Tensor, "*batch outputs"]:
        x = self.first(x)
        for before, after in self._blocks():
            x = x + after(torch.tanh(before(torch.tanh(x))))
        output: Tensor = self.last(x)
        return output

    def carry(
        self, x: Float[Tensor, "*batch inputs"], tangent: Float[Tensor, "*batch inputs"]
    ) -> tuple[Float[Tensor, "*batch outputs"], Float[Tensor, "*batch outputs"]]:
        """Output and its derivative along a tangent."""
        x, tangent = self.first(x), tangent @ self.first.weight.mT
        for before, after in self._blocks():
            change, rate = _carried_activation(x, tangent)
            change, rate = _carried_activation(before(change), rate @ before.weight.mT)
            x, tangent = x + after(change), tangent + rate @ after.weight.mT
        return self.last(x), tangent @ self.last.weight.mT

    def _blocks(self) -> list[tuple[nn.Linear, nn.Linear]]:
        layers = [layer for layer in self.hidden if isinstance(layer, nn.Linear)]
        return list(zip(layers[::2], layers[1::2], strict=True))


def _carried_activation(x: Tensor, tangent: Tensor) -> tuple[Tensor, Tensor]:
    value = torch.tanh(x)
    return value, (1 - value * value) * tangent
