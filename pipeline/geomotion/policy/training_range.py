"""Where a skill was demonstrated."""

from collections.abc import Sequence

import torch
from torch import nn

from geomotion.types import Bool, Float, State, Tensor


class TrainingRange(nn.Module):
    """The box around demonstrated states, enlarged by one margin on all sides.

    Args:
        states: Of all demonstrations, shape (point, D) [m].
        margin_m: How far outside of the box a state still counts as demonstrated [m].
        conditions: Of all demonstrations, shape (demo, K); None for a skill without.
        condition_margin: The same for conditions, of the extent of each of their entries.
    """

    lower: Tensor
    upper: Tensor

    def __init__(
        self,
        states: Float[Tensor, "point D"],
        margin_m: float,
        conditions: Float[Tensor, "demo K"] | None = None,
        condition_margin: float = 0.0,
    ) -> None:
        super().__init__()
        bounds = [(states.amin(0) - margin_m, states.amax(0) + margin_m)]
        if conditions is not None:
            low, high = conditions.amin(0), conditions.amax(0)
            bounds.append((low - condition_margin * (high - low), high + condition_margin * (high - low)))
        lower, upper = (torch.cat(sides) for sides in zip(*bounds, strict=True))
        self.register_buffer("lower", lower.float())
        self.register_buffer("upper", upper.float())

    def contains(self, x: State, conditions: Sequence[Tensor] = ()) -> Bool[Tensor, "*batch"]:
        """Whether states, with their conditions if there are any, are in the range; what is not finite is not."""
        asked = torch.cat([x, *conditions], -1)
        return ((asked >= self.lower) & (asked <= self.upper)).all(-1)
