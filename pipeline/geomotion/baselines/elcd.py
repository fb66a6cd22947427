"""Extended linearised contracting dynamics: ELCD."""

from collections.abc import Sequence

from torch import nn

from geomotion.dynamics.linear import contracting_matrix
from geomotion.networks.mlp import JacobianRoot
from geomotion.types import Matrix, State, Velocity


class ExtendedLinearField(nn.Module):
    r"""A linear system whose matrix changes with the state.

    .. math:: f(z) = A(z)\, z, \qquad A(z) = -(P_s(z)^\top P_s(z) + \epsilon I) + P_a(z) - P_a(z)^\top

    zᵀ f(z) ≤ -ε ‖z‖², so every trajectory comes to the origin at least as fast as e^{-εt}. A is not the Jacobian of f,
    which is A + (∂A/∂z) z.

    Args:
        dim: D.
        hidden_units: Widths of the hidden layers of both networks.
        activation: A key of :data:`geomotion.networks.mlp.ACTIVATIONS`.
        min_rate: ε, per time unit.

    Source: Jaffe, Davydov, Lapsekili, Singh and Bullo, 2024, Learning Neural Contracting Dynamics.
    """

    claim = (
        "ELCD claims that every trajectory contracts towards the equilibrium in the coordinates z, from which it "
        "infers that the field contracts globally in some metric, which it does not give. In the metric of z, nothing "
        "keeps the symmetric part of the Jacobian A + (∂A/∂z) z negative."
    )

    def __init__(self, dim: int, hidden_units: Sequence[int], activation: str, min_rate: float) -> None:
        super().__init__()
        self.dim = dim
        self.min_rate = min_rate
        self.symmetric_root = JacobianRoot(dim, hidden_units, activation)
        self.skew_root = JacobianRoot(dim, hidden_units, activation)

    def matrix(self, z: State) -> Matrix:
        """A(z), per time unit."""
        return contracting_matrix(self.symmetric_root(z), self.skew_root(z), self.min_rate)

    def forward(self, z: State) -> Velocity:
        velocity: Velocity = (self.matrix(z) @ z.unsqueeze(-1)).squeeze(-1)
        return velocity
