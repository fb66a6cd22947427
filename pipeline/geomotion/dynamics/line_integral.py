"""The vector field of the thesis: the line integral of a negative definite matrix (Sec. 5.1)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import torch
from torch import nn
from torchdiffeq import odeint

from geomotion.dynamics.quadrature import Integrand
from geomotion.dynamics.regularisers import Regulariser
from geomotion.types import Float, Matrix, State, States, Tensor, Velocity


@runtime_checkable
class LineIntegrator(Protocol):
    """How the integral of Eq. (5.2) is computed; :class:`GaussLegendre` is the fast one."""

    def __call__(self, integrand: Integrand, initial: State) -> State:
        """`initial` plus the integral of `integrand` over [0, 1]."""
        ...


@dataclass(frozen=True)
class RungeKutta4:
    """torchdiffeq's fourth-order Runge-Kutta (3/8 rule) with equal steps.

    Args:
        steps: Number of steps over [0, 1].
    """

    steps: int

    def __call__(self, integrand: Integrand, initial: State) -> State:
        grid = torch.linspace(0, 1, self.steps + 1, dtype=initial.dtype, device=initial.device)
        states: Tensor = odeint(_as_right_hand_side(integrand), initial, grid, method="rk4")
        return states[-1]


@dataclass(frozen=True)
class DormandPrince:
    """torchdiffeq's adaptive Runge-Kutta of order five.

    The step is shared by the batch, and the tolerances hold for the root mean square over it.

    Args:
        relative_tolerance: Of the velocity.
        absolute_tolerance: In the unit of the velocity.
    """

    relative_tolerance: float
    absolute_tolerance: float

    def __call__(self, integrand: Integrand, initial: State) -> State:
        ends = torch.tensor([0.0, 1.0], dtype=initial.dtype, device=initial.device)
        tolerances = {"rtol": self.relative_tolerance, "atol": self.absolute_tolerance}
        states: Tensor = odeint(_as_right_hand_side(integrand), initial, ends, method="dopri5", **tolerances)
        return states[-1]


def _as_right_hand_side(integrand: Integrand) -> Callable[[Tensor, Tensor], Tensor]:
    return lambda t, _: integrand(t[None]).squeeze(-2)


def line_integral(
    product: Callable[[State, Tensor], State],
    x: State,
    base_point: Float[Tensor, " D"],
    base_velocity: Float[Tensor, " D"],
    integrator: LineIntegrator,
) -> Velocity:
    """The right-hand side of Eq. (5.2).

    Args:
        product: Matrix at a state times a vector, (y, v) to Ĵ(y) v.
        x: Where to.
        base_point: x₀.
        base_velocity: ẋ₀.
        integrator: How the integral is computed.
    """
    direction = (x - base_point).unsqueeze(-2)
    # Not a nested def: evaluating its shape annotations in every call would cost a quarter of a query.
    integrand: Integrand = lambda t: product(base_point + t.unsqueeze(-1) * direction, direction)
    return integrator(integrand, base_velocity.expand_as(x))


def set_base(module: nn.Module, base_point: Float[Tensor, " D"], base_velocity: Float[Tensor, " D"]) -> None:
    """Give a module x₀ and ẋ₀, each a parameter where it is one, a buffer otherwise."""
    for name, value in (("base_point", base_point), ("base_velocity", base_velocity)):
        if isinstance(value, nn.Parameter):
            module.register_parameter(name, value)
        else:
            module.register_buffer(name, value)


class LineIntegralField(nn.Module):
    r"""Neural contractive dynamical system: a negative definite matrix, integrated from a base point.

    .. math::
        \hat J(x) = -(J_\theta(x)^\top J_\theta(x) + \operatorname{diag} \varepsilon(x)) + S(x), \qquad
        f(x) = \dot x_0 + \int_0^1 \hat J(x_0 + t (x - x_0))\, (x - x_0)\, dt

    For all parameters: sym Ĵ ≼ -min ε I, f(x₀) = ẋ₀, and (x - x₀)·(f(x) - f(x₀)) ≤ -min ε ‖x - x₀‖², up to the
    error of the integrator. For D = 1 and for constant Ĵ, the Jacobian of f is Ĵ and f contracts. The
    skew-symmetric S changes none of this, since v·Sv = 0 for every v.

    Args:
        jacobian_root: J_θ, from states (\*batch, D) to matrices (\*batch, D, D).
        regulariser: ε.
        base_point: x₀, shape (D,); learned if it is an ``nn.Parameter``, fixed otherwise.
        base_velocity: ẋ₀, shape (D,); learned if it is an ``nn.Parameter``, fixed otherwise.
        integrator: How the integral is computed.
        skew_part: S, from states (\*batch, D) to skew-symmetric matrices (\*batch, D, D); absent, Ĵ is symmetric.

    Note:
        For D ≥ 2 the claim that f contracts does not follow. The Jacobian of f is Ĵ only if every row of Ĵ is the
        gradient of a function, which a network's rows are not; the symmetric part of ∂f/∂x can have positive
        eigenvalues, and on networks trained on handwriting it mostly has. Contraction of f is therefore measured on
        its true Jacobian, never read off Ĵ.

    Source: Thesis Eq. (5.1), (5.2), (5.4), (5.7).
    """

    base_point: Tensor
    base_velocity: Tensor

    def __init__(
        self,
        jacobian_root: Callable[[State], Matrix],
        regulariser: Regulariser,
        base_point: Float[Tensor, " D"],
        base_velocity: Float[Tensor, " D"],
        integrator: LineIntegrator,
        skew_part: Callable[[State], Matrix] | None = None,
    ) -> None:
        super().__init__()
        self.dim = base_point.shape[0]
        self.jacobian_root = jacobian_root
        self.skew_part = skew_part
        self.regulariser = regulariser
        self.integrator = integrator
        set_base(self, base_point, base_velocity)

    def forward(self, x: State) -> Velocity:
        return line_integral(self._jacobian_product, x, self.base_point, self.base_velocity, self.integrator)

    def contraction_jacobian(self, x: State) -> Matrix:
        """Ĵ(x) [1/time]; the Jacobian of this field only for D = 1 or constant Ĵ."""
        root = self.jacobian_root(x)
        symmetric = -(root.mT @ root + torch.diag_embed(self.regulariser(x)))
        return symmetric if self.skew_part is None else symmetric + self.skew_part(x)

    def regularisation(self, x: States) -> Float[Tensor, ""]:
        """What the regulariser adds to the training loss, judged at these states."""
        return self.regulariser.loss(x, self.contraction_jacobian)

    def _jacobian_product(self, x: State, vector: Float[Tensor, "#*batch D"]) -> State:
        """Ĵ(x) v without forming J_θᵀJ_θ."""
        root, column = self.jacobian_root(x), vector.unsqueeze(-1)
        product = -(root.mT @ (root @ column))
        if self.skew_part is not None:
            product = product + self.skew_part(x) @ column
        return product.squeeze(-1) - self.regulariser(x) * vector
