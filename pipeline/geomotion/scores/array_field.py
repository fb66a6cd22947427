"""A field as functions of arrays, which is how scores see it."""

from typing import Any

import numpy as np
import torch
from jaxtyping import Float

from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.rollout import rollout
from geomotion.types import Tensor

Points = Float[np.ndarray, "point D"]


class ArrayField:
    """A field evaluated in its own precision, with arrays in double precision outside.

    Args:
        field: The field.
        rollout_options: Keywords of :func:`geomotion.dynamics.rollout.rollout` that choose the solver.
    """

    def __init__(self, field: ChartedField, **rollout_options: Any) -> None:
        self.field = field
        self.dtype = next(field.parameters()).dtype
        self._rollout_options = rollout_options

    def roll(
        self, starts: Float[np.ndarray, "start D"], times_s: Float[np.ndarray, " time"]
    ) -> Float[np.ndarray, "start time D"]:
        """Trajectories [m] at times after the start [s]."""
        return _array(rollout(self.field, self.tensor(starts), self.tensor(times_s), **self._rollout_options).states)

    @torch.no_grad()
    def velocity(self, states: Points, elapsed_s: Float[np.ndarray, " point"] | None = None) -> Points:
        """ẋ at each state [m/s], at times since the start of the motion [s]; without times, at mean speed."""
        if elapsed_s is None:
            return _array(self.field(self.tensor(states)))
        return _array(self.field.velocity(self.tensor(states), self.tensor(elapsed_s)[:, None]))

    @torch.no_grad()
    def to_claimed(self, states: Points) -> Points:
        """ψ at each state: the coordinates in which contraction is claimed."""
        return _array(self.field.chart.to_latent(self.tensor(states)))

    def tensor(self, values: np.ndarray) -> Tensor:
        """In the field's precision."""
        return torch.as_tensor(values, dtype=self.dtype)


def _array(values: Tensor) -> np.ndarray:
    return np.asarray(values.double().numpy())
