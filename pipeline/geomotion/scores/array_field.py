"""A field as functions of arrays, which is how scores see it."""

from copy import deepcopy
from typing import Any

import numpy as np
import torch
from jaxtyping import Float

from geomotion.dynamics.fields import ChartedField, Plan
from geomotion.dynamics.injective import rollout_on_manifold
from geomotion.dynamics.rollout import rollout
from geomotion.types import Tensor

Points = Float[np.ndarray, "point D"]
EXACT_TOLERANCES = {"relative_tolerance": 1e-9, "absolute_tolerance": 1e-11}


class ArrayField:
    """A field evaluated in its own precision, with arrays in double precision outside.

    Args:
        field: The field.
        begins_on_manifold: Whether starts of a decoded field are projected first; a motion on its way never is.
        rollout_options: Keywords of :func:`geomotion.dynamics.rollout.rollout` that choose the solver.
    """

    def __init__(self, field: ChartedField, begins_on_manifold: bool = True, **rollout_options: Any) -> None:
        self.field = field
        self.begins_on_manifold = begins_on_manifold
        self.dtype = next(field.parameters()).dtype
        self._rollout_options = rollout_options

    @property
    def is_plan(self) -> bool:
        """Whether it knows trajectories, but no velocities of states."""
        return isinstance(self.field.field, Plan)

    def roll(
        self, starts: Float[np.ndarray, "start D"], times_s: Float[np.ndarray, " time"]
    ) -> Float[np.ndarray, "start time D"]:
        """Trajectories [m] at times after the start [s]."""
        follow = rollout_on_manifold if self.begins_on_manifold and not self.field.is_onto else rollout
        return _array(follow(self.field, self.tensor(starts), self.tensor(times_s), **self._rollout_options).states)

    def later(self, begin_s: float) -> "ArrayField":
        """The same field for a motion that has run for some time already [s]."""
        return ArrayField(self.field.later(begin_s), begins_on_manifold=False, **self._rollout_options)

    def on_its_way(self) -> "ArrayField":
        """The same field, of which starts are not projected first."""
        return ArrayField(self.field, begins_on_manifold=False, **self._rollout_options)

    def begun(self, starts: Float[np.ndarray, "start D"]) -> "ArrayField":
        """The field of motions from these starts, which it may remember."""
        return ArrayField(self.field.begun(self.tensor(starts)), self.begins_on_manifold, **self._rollout_options)

    def forgetful(self) -> "ArrayField":
        """The field of states on their way, whose starts are not remembered."""
        return ArrayField(self.field.forgetful(), self.begins_on_manifold, **self._rollout_options)

    def without_offsets(
        self, states: Float[np.ndarray, "start time D"], times_s: Float[np.ndarray, " time"]
    ) -> Float[np.ndarray, "start time D"]:
        """States of motions without what they carry along, at times as :meth:`velocity` has them."""
        carried = self.field.carried
        return states if carried is None else states - _array(carried.along(self.tensor(times_s)))

    def exact(self) -> "ArrayField":
        """The same field in double precision, followed in closed form or by steps that adapt to it.

        For what is proven of solutions: a fixed step that is coarse for a steep field is wrong by any amount.
        """
        method = "closed_form" if self.field.is_solvable else "dopri5"
        exact = deepcopy(self.field).double()
        return ArrayField(exact, self.begins_on_manifold, method=method, **EXACT_TOLERANCES)

    @torch.no_grad()
    def velocity(self, states: Points, elapsed_s: Float[np.ndarray, " point"] | None = None) -> Points:
        """ẋ at each state [m/s], at times since the start of the motion [s]; without times, at mean speed."""
        if elapsed_s is None:
            return _array(self.field(self.tensor(states)))
        return _array(self.field.velocity(self.tensor(states), self.tensor(elapsed_s)[:, None]))

    @torch.no_grad()
    def to_claimed(self, states: Points) -> Float[np.ndarray, "point d"]:
        """ψ at each state: the coordinates in which contraction is claimed."""
        return _array(self.field.chart.to_latent(self.tensor(states)))

    def tensor(self, values: np.ndarray) -> Tensor:
        """In the field's precision."""
        return torch.as_tensor(values, dtype=self.dtype)


def _array(values: Tensor) -> np.ndarray:
    return np.asarray(values.double().numpy())
