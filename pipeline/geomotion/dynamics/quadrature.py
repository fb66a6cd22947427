"""Definite integrals over [0, 1] of vectorised functions: Gauss-Legendre, all nodes in one batched pass."""

from collections.abc import Callable

import numpy as np
import torch
from torch import nn

from geomotion.types import Float, State, Tensor

Integrand = Callable[[Float[Tensor, " node"]], Float[Tensor, "*batch node D"]]


class GaussLegendre(nn.Module):
    r"""Gauss-Legendre quadrature on the unit interval.

    .. math:: y_0 + \int_0^1 g(t)\,dt \approx y_0 + \sum_q w_q\, g(t_q)

    Exact for polynomials of degree 2 `count` - 1; for analytic g the error falls geometrically with `count`.

    Args:
        count: Number of nodes.
    """

    nodes: Tensor
    weights: Tensor

    def __init__(self, count: int) -> None:
        super().__init__()
        self.count = count
        for name in ("nodes", "weights"):
            self.register_buffer(name, torch.empty(count), persistent=False)
        self._fill()

    def forward(self, integrand: Integrand, initial: State) -> State:
        """`initial` plus the integral of `integrand`, which maps all nodes at once to (\\*batch, node, D)."""
        return initial + self.weights @ integrand(self.nodes)

    def _fill(self) -> None:
        nodes, weights = np.polynomial.legendre.leggauss(self.count)
        self.nodes = torch.from_numpy((nodes + 1) / 2).to(self.nodes)
        self.weights = torch.from_numpy(weights / 2).to(self.weights)

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> "GaussLegendre":
        # Called by .double(), .to() and the like: a cast from float32 would keep only half the digits.
        super()._apply(fn, recurse)  # type: ignore[no-untyped-call]
        self._fill()
        return self
