"""Demonstrations as tensors."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from geomotion.demos.demonstrations import Demonstrations
from geomotion.scores.grids import bounding_box
from geomotion.types import Float, States, Tensor


@dataclass(frozen=True)
class TrainingSet:
    """What a field is fitted to; one entry per demonstration.

    Attributes:
        times: Time since the start [s].
        states: States [m].
        velocities: Velocities [m/s].
    """

    times: tuple[Float[Tensor, " _"], ...]
    states: tuple[Float[Tensor, "_ D"], ...]
    velocities: tuple[Float[Tensor, "_ D"], ...]

    @classmethod
    def from_demonstrations(cls, demonstrations: Demonstrations, channels: Sequence[str]) -> "TrainingSet":
        """Single-precision tensors of the named channels."""

        def tensor(values: np.ndarray) -> Tensor:
            return torch.as_tensor(np.ascontiguousarray(values), dtype=torch.float32)

        return cls(
            tuple(tensor(one.time_s - one.time_s[0]) for one in demonstrations.trajectories),
            tuple(tensor(one.state(channels)) for one in demonstrations.trajectories),
            tuple(tensor(one.velocity(channels)) for one in demonstrations.trajectories),
        )

    @property
    def all_states(self) -> Float[Tensor, "point D"]:
        """States of all demonstrations."""
        return torch.cat(self.states)

    @property
    def all_velocities(self) -> Float[Tensor, "point D"]:
        """Velocities of all demonstrations."""
        return torch.cat(self.velocities)


class Surroundings:
    """The box around demonstrations, from which penalties draw states where nothing was shown.

    Args:
        data: Demonstrations.
        margin: By how much the box is larger on each side, in sizes of the bounding box.
    """

    def __init__(self, data: TrainingSet, margin: float) -> None:
        box = bounding_box([states.numpy() for states in data.states]).enlarged(margin)
        self.lower, self.upper = torch.from_numpy(box.lower), torch.from_numpy(box.upper)

    def draw(self, count: int, generator: torch.Generator) -> States:
        """Random states [m], uniform in the box."""
        share = torch.rand(count, len(self.lower), generator=generator)
        return self.lower + share * (self.upper - self.lower)


@dataclass(frozen=True)
class Geometry:
    """Place, size and time scale of demonstrations.

    Attributes:
        centre: Middle of the bounding box [m].
        scale_m: Half the longest side of the bounding box [m].
        mean: Mean of all states [m].
        goal: Mean of the last states [m].
        duration_s: Mean duration [s].
        context: How many of the last coordinates of a state stand still: the code of its condition.
    """

    centre: tuple[float, ...]
    scale_m: float
    mean: tuple[float, ...]
    goal: tuple[float, ...]
    duration_s: float
    context: int = 0

    @classmethod
    def of(cls, data: TrainingSet) -> "Geometry":
        """Measure a training set."""
        low, high = data.all_states.amin(0), data.all_states.amax(0)
        ends = torch.stack([states[-1] for states in data.states])
        return cls(
            tuple(((low + high) / 2).tolist()),
            float((high - low).max() / 2),
            tuple(data.all_states.mean(0).tolist()),
            tuple(ends.mean(0).tolist()),
            float(np.mean([float(times[-1]) for times in data.times])),
        )
