"""The diagonal ε that keeps Ĵ of the line-integral field away from zero (thesis Sec. 5.1, 5.2)."""

from typing import Protocol, runtime_checkable

import torch
from torch import nn

from geomotion.types import Float, State, Tensor


@runtime_checkable
class Regulariser(Protocol):
    """ε of Eq. (5.1), (5.4), with what learning it costs."""

    def __call__(self, x: State) -> Float[Tensor, "#*batch D"]:
        """Positive diagonal at each state [1/time], broadcastable to the states."""
        ...

    def loss(self) -> Float[Tensor, ""]:
        """Term of the total loss."""
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

    def loss(self) -> Float[Tensor, ""]:
        return self.epsilon.new_zeros(())


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
        self.epsilon_root = nn.Parameter(torch.linspace(initial_epsilon, 2 * initial_epsilon, dim).sqrt())

    @property
    def epsilon(self) -> Float[Tensor, " D"]:
        """ε, positive whatever the parameters are."""
        return self.epsilon_root.square() + 1e-10

    def forward(self, x: State) -> Float[Tensor, "#*batch D"]:
        return self.epsilon

    def loss(self) -> Float[Tensor, ""]:
        differences = (self.epsilon[0] - self.epsilon[1:]).abs()
        return -self.spread_weight * differences.clamp(max=self.spread_limit).square().sum()
