"""Multi-layer perceptrons, and the one whose output is a square matrix."""

from collections.abc import Sequence
from itertools import pairwise

from torch import nn

from geomotion.errors import UnknownName
from geomotion.types import Matrix, State

ACTIVATIONS: dict[str, type[nn.Module]] = {"tanh": nn.Tanh, "softplus": nn.Softplus, "sigmoid": nn.Sigmoid}


class MLP(nn.Sequential):
    """Fully connected layers with a smooth activation between them and none after the last.

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


class JacobianRoot(nn.Module):
    """J_θ: a network from states to square matrices.

    Source: Thesis Eq. (5.1).
    """

    def __init__(self, dim: int, hidden_units: Sequence[int], activation: str = "tanh") -> None:
        super().__init__()
        self.dim = dim
        self.network = MLP(dim, dim * dim, hidden_units, activation)

    def forward(self, x: State) -> Matrix:
        matrix: Matrix = self.network(x).unflatten(-1, (self.dim, self.dim))
        return matrix
