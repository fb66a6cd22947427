"""Demonstrations with conditions as demonstrations of a state that carries its condition along."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import torch
from jaxtyping import Float

from geomotion.errors import DatasetError, InvalidSetting
from geomotion.training.data import Geometry, TrainingSet
from geomotion.types import Tensor

NEGLIGIBLE = 1e-6  # share of the largest variation of conditions below which a direction does not count


@dataclass(frozen=True)
class Conditioning:
    """How conditions enter a field, and where motions end under each.

    A condition c is seen as its code, an affine image without the directions in which no demonstrated condition
    differs, so that seven labels out of seven are six numbers; codes of demonstrated conditions fill the unit ball.

    Attributes:
        names: Names of the entries of a condition.
        demonstrated: Conditions of the training demonstrations by name.
        mean: Of the demonstrated conditions, shape (K,).
        directions: From differences to the mean to codes, shape (K, R).
        goal: End of motions at the mean condition, shape (D,) [m].
        goal_slopes: How it moves with the code, shape (D, R) [m].
        follows_goal: Whether the field is learned in a frame that moves along with the goal.
    """

    names: tuple[str, ...]
    demonstrated: Mapping[str, tuple[float, ...]]
    mean: tuple[float, ...]
    directions: tuple[tuple[float, ...], ...]
    goal: tuple[float, ...]
    goal_slopes: tuple[tuple[float, ...], ...]
    follows_goal: bool

    @classmethod
    def fit(
        cls,
        names: Sequence[str],
        demonstrated: Mapping[str, tuple[float, ...]],
        conditions: Float[np.ndarray, "demo K"],
        ends: Float[np.ndarray, "demo D"],
        follows_goal: bool,
    ) -> "Conditioning":
        """Measure conditions and where their demonstrations end: x*(c), affine in c, by least squares.

        Raises:
            DatasetError: If the conditions do not differ.
        """
        distinct = np.array(list(demonstrated.values()))
        mean, spread = distinct.mean(0), distinct.std(0)
        if not (spread > 0).any():
            raise DatasetError("conditions", f"all demonstrations have {distinct[0].tolist()}; expected different ones")
        unit = np.divide(1.0, spread, out=np.zeros_like(spread), where=spread > 0)
        _, sizes, axes = np.linalg.svd((distinct - mean) * unit, full_matrices=False)
        directions = unit[:, None] * axes[sizes > NEGLIGIBLE * sizes[0]].T
        directions = directions / np.linalg.norm((distinct - mean) @ directions, axis=1).max()
        codes = (conditions - mean) @ directions
        design = np.concatenate([np.ones((len(codes), 1)), codes], axis=1)
        solution = np.linalg.lstsq(design, ends, rcond=None)[0]
        return cls(
            tuple(names), dict(demonstrated), _tuple(mean), _tuple(directions), _tuple(solution[0]),
            _tuple(solution[1:].T), follows_goal,
        )  # fmt: skip

    @property
    def context(self) -> int:
        """R, entries of a code."""
        return len(self.directions[0])

    def checked(self, condition: object, key: str = "condition") -> tuple[float, ...]:
        """A condition of the right size.

        Raises:
            InvalidSetting: If it is not: says how many numbers there have to be, their names, and what was shown.
        """
        values = list(condition) if isinstance(condition, list | tuple) else []
        are_numbers = all(isinstance(value, int | float) for value in values)
        if not are_numbers or len(values) != len(self.names) or not np.isfinite(values).all():
            shown = "; ".join(f"{name}: {list(values)}" for name, values in self.demonstrated.items())
            noun = "number" if len(self.names) == 1 else "numbers"
            raise InvalidSetting(
                key, condition, f"{len(self.names)} finite {noun} ({', '.join(self.names)}), such as {shown}"
            )
        return tuple(float(value) for value in values)

    def codes(self, conditions: Float[np.ndarray, "*batch K"]) -> Float[np.ndarray, "*batch R"]:
        """Codes of conditions."""
        return np.asarray((conditions - np.array(self.mean)) @ np.array(self.directions))

    def goal_at(self, condition: Float[np.ndarray, " K"]) -> Float[np.ndarray, " D"]:
        """x*(c) [m]."""
        return np.asarray(np.array(self.goal) + np.array(self.goal_slopes) @ self.codes(condition))

    def shift_at(self, condition: Float[np.ndarray, " K"]) -> Float[np.ndarray, " D"]:
        """How far the frame of the field is moved [m]."""
        goal = np.array(self.goal)
        return np.asarray(self.goal_at(condition) - goal if self.follows_goal else np.zeros_like(goal))

    def document(self) -> dict[str, Any]:
        """Plain types."""
        return asdict(self)

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> "Conditioning":
        """What :meth:`document` gave."""
        values = {name: _tuple(value) if isinstance(value, list | tuple) else value for name, value in document.items()}
        values["demonstrated"] = {name: _tuple(value) for name, value in document["demonstrated"].items()}
        return cls(**values)


def with_conditions(
    data: TrainingSet, conditions: Float[np.ndarray, "demo K"], conditioning: Conditioning
) -> tuple[TrainingSet, Geometry]:
    """Demonstrations of (x, c): states relative to the moved frame, and codes as lengths that stand still.

    A code of one is as long as half of the demonstrations' longest side, so that both fill the same interval once
    they are scaled. The frame's centre is the goal where it follows the goal.
    """
    shifts = [torch.tensor(conditioning.shift_at(condition), dtype=torch.float32) for condition in conditions]
    relative = replace(data, states=tuple(states - shift for states, shift in zip(data.states, shifts, strict=True)))
    plain = Geometry.of(relative)
    codes = torch.tensor(conditioning.codes(conditions) * plain.scale_m, dtype=torch.float32)
    states = tuple(_beside(states, code) for states, code in zip(relative.states, codes, strict=True))
    velocities = tuple(_beside(velocities, torch.zeros(conditioning.context)) for velocities in data.velocities)
    padding = (0.0,) * conditioning.context
    geometry = Geometry(
        (plain.goal if conditioning.follows_goal else plain.centre) + padding,
        plain.scale_m,
        plain.mean + padding,
        plain.goal + padding,
        plain.duration_s,
        context=conditioning.context,
    )
    return replace(data, states=states, velocities=velocities), geometry


def _beside(states: Tensor, code: Tensor) -> Tensor:
    return torch.cat([states, code.expand(len(states), -1)], -1)


def _tuple(values: Any) -> Any:
    if isinstance(values, np.ndarray):
        values = values.tolist()
    return tuple(_tuple(value) for value in values) if isinstance(values, list | tuple) else values
