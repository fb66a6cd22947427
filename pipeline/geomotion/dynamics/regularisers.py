"""The diagonal ε that keeps Ĵ of the line-integral field away from zero (thesis Sec. 5.1, 5.2)."""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import torch
from torch import nn

from geomotion.types import Float, Matrix, State, States, Tensor

ContractionJacobian = Callable[[State], Matrix]

SMALLEST_EPSILON = 1e-10  # Sec. 5.2.1: squares of learned numbers can vanish


@runtime_checkable
class Regulariser(Protocol):
    """ε of Eq. (5.1), (5.4), with what learning it costs."""

    def __call__(self, x: State) -> Float[Tensor, "#*batch D"]:
        """Positive diagonal at each state [1/time], broadcastable to the states."""
        ...

    def loss(self, x: States, jacobian: ContractionJacobian) -> Float[Tensor, ""]:
        """Term of the total loss, averaged over states; `jacobian` is Ĵ, which not every regulariser looks at."""
        ...


class ConstantRegulariser(nn.Module):
    """The same fixed ε for every state and axis.

    Args:
        epsilon: ε [1/time].
        dim: Number of axes.

    Source: Thesis Eq. (5.1).
    """

    epsilon: Tensor

    def __init__(self, epsilon: float, dim: int) -> None:
        super().__init__()
        self.register_buffer("epsilon", torch.full((dim,), epsilon))

    def forward(self, x: State) -> Float[Tensor, "#*batch D"]:
        return self.epsilon

    def loss(self, x: States, jacobian: ContractionJacobian) -> Float[Tensor, ""]:
        return self.epsilon.new_zeros(())


class EigenvalueRegulariser(ConstantRegulariser):
    r"""A fixed ε, and a loss that pushes the eigenvalues of Ĵ away from the largest of them.

    .. math:: L_\varepsilon = -\beta\, \operatorname{mean}_x \sum_n \min(\lambda_{\max} - \lambda_n, s)^2

    with the eigenvalues λ of sym Ĵ(x), which are those of Ĵ where it is symmetric.

    Args:
        epsilon: ε [1/time].
        dim: Number of axes.
        spread_weight: β.
        spread_limit: s, the difference beyond which the loss stops paying [1/time].

    Source: Thesis Eq. (5.6).

    Note:
        Two choices. The thesis leaves open which eigenvalue the others leave: here the one nearest zero, whose
        contraction is slowest. And Eq. (5.6) has no lower bound; s bounds it by -β (D - 1) s².
    """

    def __init__(self, epsilon: float, dim: int, spread_weight: float, spread_limit: float) -> None:
        super().__init__(epsilon, dim)
        self.spread_weight = spread_weight
        self.spread_limit = spread_limit

    def loss(self, x: States, jacobian: ContractionJacobian) -> Float[Tensor, ""]:
        matrix = jacobian(x)
        eigenvalues = torch.linalg.eigvalsh((matrix + matrix.mT) / 2)  # ascending
        return spread_loss(eigenvalues.flip(-1), self.spread_weight, self.spread_limit)


class StateIndependentRegulariser(nn.Module):
    r"""A learned vector ε whose entries are pushed apart, so that the field contracts at different rates.

    .. math:: \varepsilon_i = \hat\varepsilon_i^2 + 10^{-10}, \qquad
        L_\varepsilon = -\beta \sum_{n \ge 2} \min(|\varepsilon_1 - \varepsilon_n|, s)^2

    Args:
        initial_epsilon: ε_1 before training [1/time].
        dim: Number of axes.
        spread_weight: β.
        spread_limit: s, the difference beyond which the loss stops paying [1/time].

    Source: Thesis Eq. (5.4), (5.5).

    Note:
        Two deviations. Eq. (5.5) has no lower bound, so nothing but the velocity loss would keep ε from growing for
        ever: s bounds it by -β (D - 1) s². And equal entries have no gradient in Eq. (5.5), so training starts from
        entries spaced evenly between `initial_epsilon` and its double.
    """

    def __init__(self, initial_epsilon: float, dim: int, spread_weight: float, spread_limit: float) -> None:
        super().__init__()
        self.spread_weight = spread_weight
        self.spread_limit = spread_limit
        self.epsilon_root = nn.Parameter(unequal_roots(initial_epsilon, dim))

    @property
    def epsilon(self) -> Float[Tensor, " D"]:
        """ε, positive whatever the parameters are."""
        return self.epsilon_root.square() + SMALLEST_EPSILON

    def forward(self, x: State) -> Float[Tensor, "#*batch D"]:
        return self.epsilon

    def loss(self, x: States, jacobian: ContractionJacobian) -> Float[Tensor, ""]:
        return spread_loss(self.epsilon, self.spread_weight, self.spread_limit)


class StateDependentRegulariser(nn.Module):
    r"""ε as a function of the state, its entries pushed apart at every state.

    .. math:: \varepsilon(x) = g_\delta(x)^2 + 10^{-10}, \qquad
        L_\varepsilon = -\beta\, \operatorname{mean}_x \sum_{n \ge 2} \min(|\varepsilon_1(x) - \varepsilon_n(x)|, s)^2

    Args:
        epsilon_root: g_δ, from states (\*batch, D) to vectors (\*batch, D) whose entries should differ before training
            (:func:`unequal_roots`), because equal entries have no gradient in the loss.
        spread_weight: β.
        spread_limit: s, the difference beyond which the loss stops paying [1/time].

    Source: Thesis Eq. (5.4), (5.5), Sec. 5.2.1.

    Note:
        ε is nearly zero wherever an entry of g_δ changes its sign: the only lower bound for all parameters is 1e-10.
    """

    def __init__(self, epsilon_root: Callable[[State], State], spread_weight: float, spread_limit: float) -> None:
        super().__init__()
        self.epsilon_root = epsilon_root
        self.spread_weight = spread_weight
        self.spread_limit = spread_limit

    def forward(self, x: State) -> Float[Tensor, "#*batch D"]:
        return self.epsilon_root(x).square() + SMALLEST_EPSILON

    def loss(self, x: States, jacobian: ContractionJacobian) -> Float[Tensor, ""]:
        return spread_loss(self(x), self.spread_weight, self.spread_limit)


def unequal_roots(initial_epsilon: float, dim: int) -> Float[Tensor, " D"]:
    """Square roots of entries spaced evenly between `initial_epsilon` and its double."""
    return torch.linspace(initial_epsilon, 2 * initial_epsilon, dim).sqrt()


def spread_loss(values: Float[Tensor, "*batch D"], weight: float, limit: float) -> Float[Tensor, ""]:
    """Minus `weight` times the squared differences to the first value, each capped at `limit`; mean over the batch."""
    differences = (values[..., :1] - values[..., 1:]).abs()
    return -weight * differences.clamp(max=limit).square().sum(-1).mean()
