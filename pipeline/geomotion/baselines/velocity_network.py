"""A network that gives the velocity itself."""

from collections.abc import Sequence

from torch import nn

from geomotion.networks.mlp import MLP
from geomotion.types import State, Velocity


class VelocityNetwork(nn.Module):
    """ẋ = g(x) with a fully connected network g: nothing makes it contract, or stop anywhere.

    Fitted to velocities it is the MLP of Fig. 5.11-c; fitted to trajectories, the neural ODE of Fig. 5.11-d.

    Args:
        dim: D.
        hidden_units: Widths of the hidden layers.
        activation: A key of :data:`geomotion.networks.mlp.ACTIVATIONS`.

    Source: Thesis Sec. 5.6.2.
    """

    def __init__(self, dim: int, hidden_units: Sequence[int], activation: str) -> None:
        super().__init__()
        self.dim = dim
        self.network = MLP(dim, dim, hidden_units, activation)

    def forward(self, x: State) -> Velocity:
        velocity: Velocity = self.network(x)
        return velocity
