"""Demonstrations as tensors."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

import numpy as np
import torch

from geomotion.demos.demonstrations import Demonstrations
from geomotion.dynamics.start_memory import StartMemory
from geomotion.scores.grids import bounding_box
from geomotion.types import Float, Int, States, Tensor


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

    def select(self, demos: Sequence[int] | Int[np.ndarray, " demo"]) -> "TrainingSet":
        """Only these demonstrations."""
        parts = (self.times, self.states, self.velocities)
        return TrainingSet(*(tuple(part[demo] for demo in demos) for part in parts))

    def without_offsets(self, memory: StartMemory) -> "TrainingSet":
        """What is left of demonstrations without what their starts carry along: they all begin at the mean start."""
        carried = [memory.carried(states[0]) for states in self.states]
        every = list(zip(carried, self.times, self.states, self.velocities, strict=True))
        return TrainingSet(
            self.times,
            tuple(states - one.along(times) for one, times, states, _ in every),
            tuple(velocities - one.velocity(times[:, None]) for one, times, _, velocities in every),
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

    States that carry conditions are drawn with those of the demonstrations, each in the box around its own.

    Args:
        data: Demonstrations.
        margin: By how much the box is larger on each side, in sizes of the bounding box.
        context: How many of the last coordinates are the code of a condition.
    """

    def __init__(self, data: TrainingSet, margin: float, context: int = 0) -> None:
        groups: dict[tuple[float, ...], list[np.ndarray]] = {}
        for states in data.states:
            moving = states.shape[1] - context
            groups.setdefault(tuple(states[0, moving:].tolist()), []).append(states[:, :moving].numpy())
        boxes = [bounding_box(group).enlarged(margin) for group in groups.values()]
        self.codes = torch.tensor(list(groups))
        self.lower = torch.from_numpy(np.stack([box.lower for box in boxes]))
        self.upper = torch.from_numpy(np.stack([box.upper for box in boxes]))

    def draw(self, count: int, generator: torch.Generator) -> States:
        """Random states [m], uniform in each box, as many in each."""
        box = torch.arange(count) % len(self.codes)
        share = torch.rand(count, self.lower.shape[1], generator=generator)
        states = self.lower[box] + share * (self.upper - self.lower)[box]
        return torch.cat([states, self.codes[box]], dim=-1)


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
        axes: Principal axes of the states about the goal, D x D numbers row by row, each column an axis, the longest
            first; empty for states in a plane.
    """

    centre: tuple[float, ...]
    scale_m: float
    mean: tuple[float, ...]
    goal: tuple[float, ...]
    duration_s: float
    context: int = 0
    axes: tuple[float, ...] = ()

    @classmethod
    def of(cls, data: TrainingSet) -> "Geometry":
        """Measure a training set."""
        low, high = data.all_states.amin(0), data.all_states.amax(0)
        goal = torch.stack([states[-1] for states in data.states]).mean(0)
        return cls(
            tuple(((low + high) / 2).tolist()),
            float((high - low).max() / 2),
            tuple(data.all_states.mean(0).tolist()),
            tuple(goal.tolist()),
            float(np.mean([float(times[-1]) for times in data.times])),
            axes=tuple(principal_axes(data.all_states - goal).flatten().tolist()) if len(goal) > 2 else (),
        )

    @classmethod
    def of_prior(cls, dim: int, duration_s: float) -> "Geometry":
        """Of codes that are distributed as N(0, I), which is all that is known of them before training."""
        zeros = (0.0,) * dim
        axes = tuple(torch.eye(dim).flatten().tolist()) if dim > 2 else ()
        return cls(zeros, 1.0, zeros, zeros, duration_s, axes=axes)


def part_slices(dim: int, parts: Sequence[int] | None) -> list[slice]:
    """Where the parts of a state are, from how many coordinates each has; None: all of them are one part."""
    ends = [dim] if parts is None else list(accumulate(parts))
    return [slice(*bounds) for bounds in pairwise([0, *ends])]


def principal_axes(offsets: Float[Tensor, "point D"]) -> Float[Tensor, "D D"]:
    """Orthonormal directions in the order in which offsets extend along them, as columns."""
    _, _, directions = torch.linalg.svd(offsets.double(), full_matrices=len(offsets) < offsets.shape[1])
    axes: Tensor = directions.T.float()
    return axes
