"""Descent along straight lines in a flow's coordinates: the field of Euclideanizing flows."""

from collections.abc import Sequence

from torch import nn

from geomotion.networks.mlp import MLP
from geomotion.types import State, Velocity

NEAR_GOAL = 1e-2  # δ, in units of the data


class NaturalDescent(nn.Module):
    r"""Natural gradient descent of the distance to the origin, at a learned speed.

    .. math:: f(z) = -e^{s(z)}\, z / \sqrt{\|z\|^2 + \delta^2}

    In the paper δ = 0, which leaves no limit at the goal: numerical solutions chatter about it. Here motions end within
    δ as those of a linear system do.

    Behind a chart ψ this is ẋ = -e^{s} G(x)⁻¹ ∇ₓ‖ψ(x)‖ with G = DψᵀDψ. The paper's logarithm of the speed, s, is a
    network of x; here it is one of z = ψ(x), which can be the same function.

    Args:
        dim: D.
        hidden_units: Widths of the hidden layers of s.
        activation: A key of :data:`geomotion.networks.mlp.ACTIVATIONS`.

    Source: Rana, Li, Fox, Boots, Ramos and Ratliff, 2020, Euclideanizing Flows.
    """

    claim = (
        "Euclideanizing flows claim global asymptotic stability: ‖ψ(x)‖ falls along every trajectory, on a straight "
        "line in z. Contraction is not claimed: with a speed that changes with the state, motions on neighbouring "
        "lines may part."
    )

    def __init__(self, dim: int, hidden_units: Sequence[int], activation: str) -> None:
        super().__init__()
        self.dim = dim
        self.log_speed = MLP(dim, 1, hidden_units, activation)

    def forward(self, z: State) -> Velocity:
        distance = (z.square().sum(-1, keepdim=True) + NEAR_GOAL**2).sqrt()
        velocity: Velocity = -self.log_speed(z).exp() * z / distance
        return velocity
