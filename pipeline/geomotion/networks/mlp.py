"""Multi-layer perceptrons, and those whose output is a matrix."""

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import nn

from geomotion.errors import UnknownName
from geomotion.types import Float, Matrix, Tensor

ACTIVATIONS: dict[str, type[nn.Module]] = {
    "tanh": nn.Tanh,
    "softplus": nn.Softplus,
    "sigmoid": nn.Sigmoid,
    "silu": nn.SiLU,
    "elu": nn.ELU,
    "relu": nn.ReLU,  # has kinks
}


class MLP(nn.Sequential):
    """Fully connected layers with an activation between them and none after the last.

    Args:
        inputs: Size of the input.
        outputs: Size of the output.
        hidden_units: Widths of the hidden layers.
        activation: A key of :data:`ACTIVATIONS`.

    Raises:
        UnknownName: If there is no such activation.
    """

    def __init__(self, inputs: int, outputs: int, hidden_units: Sequence[int], activation: str = "tanh") -> None:
        if activation not in ACTIVATIONS:
            raise UnknownName("activation", activation, ACTIVATIONS)
        layers: list[nn.Module] = []
        for width_in, width_out in pairwise((inputs, *hidden_units)):
            layers += [nn.Linear(width_in, width_out), ACTIVATIONS[activation]()]
        super().__init__(*layers, nn.Linear((inputs, *hidden_units)[-1], outputs))

    def start_at(self, output: Float[Tensor, " outputs"]) -> None:
        """Make the output the same everywhere, until training changes it."""
        last = self[-1]
        assert isinstance(last, nn.Linear)
        nn.init.zeros_(last.weight)
        with torch.no_grad():
            last.bias.copy_(output)


class JacobianRoot(nn.Module):
    """J_θ: a network from states to square matrices; with context, from states and conditions side by side.

    Source: Thesis Eq. (5.1), (5.13).
    """

    def __init__(self, dim: int, hidden_units: Sequence[int], activation: str = "tanh", context: int = 0) -> None:
        super().__init__()
        self.dim = dim
        self.network = MLP(dim + context, dim * dim, hidden_units, activation)

    def forward(self, x: Float[Tensor, "*batch inputs"]) -> Matrix:
        matrix: Matrix = self.network(x).unflatten(-1, (self.dim, self.dim))
        return matrix


class SkewMatrix(nn.Module):
    r"""A network from states to skew-symmetric matrices, one output for each pair of axes.

    .. math:: S(x) = \sum_{i > j} s_{ij}(x)\, (e_i e_j^\top - e_j e_i^\top)

    Source: Thesis Eq. (5.8), for any number of axes D ≥ 2.
    """

    basis: Tensor

    def __init__(self, dim: int, hidden_units: Sequence[int], activation: str = "tanh", context: int = 0) -> None:
        super().__init__()
        self.dim = dim
        rows, columns = torch.tril_indices(dim, dim, -1)
        lower = torch.zeros(len(rows), dim, dim)
        lower[torch.arange(len(rows)), rows, columns] = 1
        self.register_buffer("basis", (lower - lower.mT).flatten(1), persistent=False)
        self.network = MLP(dim + context, len(rows), hidden_units, activation)

    def forward(self, x: Float[Tensor, "*batch inputs"]) -> Matrix:
        matrix: Matrix = (self.network(x) @ self.basis).unflatten(-1, (self.dim, self.dim))
        return matrix
