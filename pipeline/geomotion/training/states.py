"""What a manifold is learned on, whatever its states are: registered, carried to common ends, mixed."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Bool, Float

from geomotion.planning.carrying import carried_to
from geomotion.planning.registration import register
from geomotion.scores.paths import MotionPath
from geomotion.scores.pose_support import Support
from geomotion.types import Tensor

Scaled = Float[np.ndarray, "state D"]


@runtime_checkable
class StateSpace(Protocol):
    """Where states live, with the place and size of the demonstrated ones.

    Attributes:
        scale_m: Length that counts as one unit.
    """

    @property
    def scale_m(self) -> float: ...

    def scaled(self, path: MotionPath) -> Scaled:
        """States as the network sees them."""
        ...

    def path(self, scaled: Scaled) -> MotionPath:
        """The states that a network means."""
        ...

    def separation(self, states: MotionPath, one: MotionPath) -> Float[np.ndarray, " state"]:
        """Distances of states to one, in units of the scale."""
        ...

    def allows(self, states: MotionPath) -> Bool[np.ndarray, " state"]:
        """Whether the robot can be in states."""
        ...

    def support(self, demonstrations: Sequence[MotionPath]) -> Support:
        """Demonstrated states, ready for queries."""
        ...

    def document(self) -> dict[str, Any]:
        """What it takes to make it again, as JSON types."""
        ...


@dataclass(frozen=True)
class TrainingSet:
    """What a manifold is fitted to.

    Attributes:
        space: Where the states live.
        groups: Number of the group of each demonstration.
        originals: Demonstrations as they are.
        paths: Demonstrations, carried to the mean start and goal of their group if asked for.
        progress: Share of the motion that is done at each of their states.
    """

    space: StateSpace
    groups: tuple[int, ...]
    originals: tuple[MotionPath, ...]
    paths: tuple[MotionPath, ...]
    progress: tuple[Float[np.ndarray, " state"], ...]

    @classmethod
    def of(cls, space: StateSpace, paths: Sequence[MotionPath], groups: Sequence[str], carry: bool) -> "TrainingSet":
        """Register demonstrations to each other within their groups.

        Args:
            space: Where their states live.
            paths: Demonstrations with equal numbers of states, even in time.
            groups: Name of the group of each one.
            carry: Whether to carry each one to the mean start and goal of its group.
        """
        names = list(dict.fromkeys(groups))
        numbers = tuple(names.index(group) for group in groups)
        progress: dict[int, Float[np.ndarray, " state"]] = {}
        carried: dict[int, MotionPath] = dict(enumerate(paths))
        for group in range(len(names)):
            members = [number for number, own in enumerate(numbers) if own == group]
            progress |= dict(zip(members, register([space.scaled(paths[one]) for one in members]), strict=True))
            if carry:
                ends = _mean_ends([paths[one] for one in members])
                carried |= {one: _carried(paths[one], progress[one], ends) for one in members}
        order = range(len(paths))
        shares = tuple(progress[one] for one in order)
        return cls(space, numbers, tuple(paths), tuple(carried[one] for one in order), shares)

    def tensors(self, mixed_copies: int, seed: int) -> tuple[Tensor, Tensor]:
        """States and progress of all demonstrations as single-precision tensors, shapes (point, D) and (point,).

        Args:
            mixed_copies: For each demonstration, how many mixtures of two of its group are added.
            seed: Of the mixtures.
        """
        mixtures = self.mixtures(mixed_copies, seed)
        states = np.concatenate([self.space.scaled(path) for path in (*self.paths, *(one.path for one in mixtures))])
        progress = np.concatenate([*self.progress, *(one.progress for one in mixtures)])
        return torch.as_tensor(states, dtype=torch.float32), torch.as_tensor(progress, dtype=torch.float32)

    def mixtures(self, copies: int, seed: int) -> list["Mixture"]:
        """Two demonstrations of one group in random shares, at equal progress: what lies between them.

        Args:
            copies: How many for each demonstration.
            seed: Of partners and shares.
        """
        generator = np.random.default_rng(seed)
        found = []
        for one, path in enumerate(self.paths):
            others = [other for other, group in enumerate(self.groups) if group == self.groups[one] and other != one]
            for _ in range(copies if others else 0):
                other, share = int(generator.choice(others)), generator.uniform()
                theirs = self.paths[other].vectors.T
                matched = np.stack(
                    [np.interp(self.progress[one], self.progress[other], axis) for axis in theirs], axis=1
                )
                mixed = path.with_vectors((1 - share) * path.vectors + share * matched)
                found.append(Mixture(mixed, self.progress[one], self.groups[one]))
        return found


@dataclass(frozen=True)
class Mixture:
    """What lies between two demonstrations.

    Attributes:
        path: States.
        progress: At each.
        group: Of both.
    """

    path: MotionPath
    progress: Float[np.ndarray, " state"]
    group: int


def _mean_ends(paths: Sequence[MotionPath]) -> MotionPath:
    return paths[0].with_vectors(np.mean([path.vectors[[0, -1]] for path in paths], axis=0))


def _carried(path: MotionPath, progress: Float[np.ndarray, " state"], ends: MotionPath) -> MotionPath:
    return carried_to(path, ends, progress)
