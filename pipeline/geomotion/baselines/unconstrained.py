"""The thesis' field without its constraint."""

from collections.abc import Callable

from torch import nn

from geomotion.dynamics.line_integral import LineIntegrator, line_integral, set_base
from geomotion.types import Float, Matrix, State, Tensor, Velocity


class UnconstrainedLineIntegral(nn.Module):
    r"""The line integral of any matrix field, in place of a negative definite one.

    .. math:: f(x) = \dot x_0 + \int_0^1 A_\theta(x_0 + t (x - x_0))\, (x - x_0)\, dt

    Args:
        matrix: A_θ, from states (\*batch, D) to matrices (\*batch, D, D).
        base_point: x₀, shape (D,); learned if it is an ``nn.Parameter``, fixed otherwise.
        base_velocity: ẋ₀, shape (D,); learned if it is an ``nn.Parameter``, fixed otherwise.
        integrator: How the integral is computed.

    Source: Thesis Sec. 5.6.2, Fig. 5.11-b.
    """

    base_point: Tensor
    base_velocity: Tensor

    def __init__(
        self,
        matrix: Callable[[State], Matrix],
        base_point: Float[Tensor, " D"],
        base_velocity: Float[Tensor, " D"],
        integrator: LineIntegrator,
    ) -> None:
        super().__init__()
        self.dim = base_point.shape[0]
        self.matrix = matrix
        self.integrator = integrator
        set_base(self, base_point, base_velocity)

    def forward(self, x: State) -> Velocity:
        return line_integral(self._product, x, self.base_point, self.base_velocity, self.integrator)

    def _product(self, x: State, vector: Float[Tensor, "#*batch D"]) -> State:
        product: Tensor = (self.matrix(x) @ vector.unsqueeze(-1)).squeeze(-1)
        return product
