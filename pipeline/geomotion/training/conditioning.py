"""Demonstrations with conditions as demonstrations of a state that carries its condition along."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import torch
from jaxtyping import Float

from geomotion.errors import DatasetError, InvalidSetting
from geomotion.training.barycentric import barycentric_coordinates
from geomotion.training.data import Geometry, TrainingSet
from geomotion.types import Tensor


@dataclass(frozen=True)
class Frame:
    """How the motions under one condition lie in the robot's coordinates: x = shift + stretch y, after slowdown t.

    Attributes:
        shift_m: Where the origin of y lies, shape (D,) [m].
        stretch: By which lengths are larger than those of y.
        slowdown: By which times are longer.
    """

    shift_m: Float[np.ndarray, " D"]
    stretch: float
    slowdown: float


@dataclass(frozen=True)
class Conditioning:
    """How conditions enter a field, and where, how large and how long motions are under each.

    A condition c is seen as its code: barycentric coordinates between as many demonstrated conditions, the corners, as
    its directions need in which these differ. They are affine in c and add up to one. Labels are corners, all of them,
    so that what is linear in the code has parameters of its own for each.

    Attributes:
        names: Names of the entries of a condition.
        demonstrated: Conditions of the training demonstrations by name.
        offset: Code of the condition 0, shape (R,).
        directions: From conditions to their part of the code, shape (K, R).
        goals: Ends of motions at each corner, shape (R, D) [m].
        size_m: Half of the longest side of the box around the motions under a condition, geometric mean [m].
        duration_s: Their duration, geometric mean [s].
        log_stretches: Logarithms of the size at each corner over the mean, shape (R,).
        log_slowdowns: Logarithms of the duration at each corner over the mean, shape (R,).
        moves_frame: Whether the field is learned in frames that follow goal, size and duration.
    """

    names: tuple[str, ...]
    demonstrated: Mapping[str, tuple[float, ...]]
    offset: tuple[float, ...]
    directions: tuple[tuple[float, ...], ...]
    goals: tuple[tuple[float, ...], ...]
    size_m: float
    duration_s: float
    log_stretches: tuple[float, ...]
    log_slowdowns: tuple[float, ...]
    moves_frame: bool

    @classmethod
    def fit(
        cls,
        names: Sequence[str],
        demonstrated: Mapping[str, tuple[float, ...]],
        conditions: Float[np.ndarray, "demo K"],
        data: TrainingSet,
        moves_frame: bool,
    ) -> "Conditioning":
        """Measure conditions and motions under each: goals and logarithms affine in c, by least squares.

        Raises:
            DatasetError: If the conditions do not differ, or nothing moves under one of them.
        """
        distinct = np.array(list(demonstrated.values()))
        offset, directions = barycentric_coordinates(distinct)
        motions = [data.select(np.flatnonzero((conditions == one).all(1))) for one in distinct]
        measured = [Geometry.of(motion) for motion in motions]
        for name, one in zip(demonstrated, measured, strict=True):
            if one.scale_m == 0:
                raise DatasetError(name, "the demonstrations stay where they start; expected motion")
        log_units = np.log([(one.scale_m, one.duration_s) for one in measured])
        means = log_units.mean(0)
        values = np.concatenate([log_units - means, [one.goal for one in measured]], axis=1)
        at_corners = np.linalg.lstsq(offset + distinct @ directions, values, rcond=None)[0]
        size_m, duration_s = np.exp(means)
        return cls(
            tuple(names), dict(demonstrated), _tuple(offset), _tuple(directions), _tuple(at_corners[:, 2:]),
            float(size_m), float(duration_s), _tuple(at_corners[:, 0]), _tuple(at_corners[:, 1]), moves_frame,
        )  # fmt: skip

    @property
    def context(self) -> int:
        """R, entries of a code."""
        return len(self.offset)

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
        return np.asarray(np.array(self.offset) + conditions @ np.array(self.directions))

    def goal_at(self, condition: Float[np.ndarray, " K"]) -> Float[np.ndarray, " D"]:
        """x*(c) [m]."""
        return np.asarray(self.codes(condition) @ np.array(self.goals))

    def frame_at(self, condition: Float[np.ndarray, " K"]) -> Frame:
        """The frame in which the field of this condition is learned; without moving ones, that of the robot."""
        if not self.moves_frame:
            return Frame(np.zeros(len(self.goals[0])), 1.0, 1.0)
        code = self.codes(condition)
        stretch, slowdown = np.exp([code @ np.array(logs) for logs in (self.log_stretches, self.log_slowdowns)])
        return Frame(self.goal_at(condition), float(stretch), float(slowdown))

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
    """Demonstrations of (x, c): motions in the frames of their conditions, and codes as lengths that stand still.

    A code of one is as long as the unit to which states are scaled.
    """
    relative = _in_frames(data, [conditioning.frame_at(condition) for condition in conditions])
    plain = Geometry.of(relative)
    if conditioning.moves_frame:
        origin = (0.0,) * len(plain.goal)
        plain = Geometry(origin, conditioning.size_m, plain.mean, origin, conditioning.duration_s)
    padding = (0.0,) * conditioning.context
    geometry = Geometry(
        plain.centre + padding,
        plain.scale_m,
        plain.mean + padding,
        plain.goal + padding,
        plain.duration_s,
        context=conditioning.context,
    )
    codes = torch.tensor(conditioning.codes(conditions) * geometry.scale_m, dtype=torch.float32)
    states = tuple(_beside(states, code) for states, code in zip(relative.states, codes, strict=True))
    velocities = tuple(_beside(velocities, torch.zeros(conditioning.context)) for velocities in relative.velocities)
    return replace(relative, states=states, velocities=velocities), geometry


def _in_frames(data: TrainingSet, frames: Sequence[Frame]) -> TrainingSet:
    """Each demonstration in the coordinates and times of its frame."""
    each = list(zip(data.times, data.states, data.velocities, frames, strict=True))
    return TrainingSet(
        tuple(times / frame.slowdown for times, _, _, frame in each),
        tuple((states - torch.tensor(frame.shift_m).to(states)) / frame.stretch for _, states, _, frame in each),
        tuple(velocities * (frame.slowdown / frame.stretch) for _, _, velocities, frame in each),
    )


def _beside(states: Tensor, code: Tensor) -> Tensor:
    return torch.cat([states, code.expand(len(states), -1)], -1)


def _tuple(values: Any) -> Any:
    if isinstance(values, np.ndarray):
        values = values.tolist()
    return tuple(_tuple(value) for value in values) if isinstance(values, list | tuple) else values
