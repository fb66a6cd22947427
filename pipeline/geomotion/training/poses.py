"""Demonstrated poses as a training set: registered, carried to common ends, mixed, and doubled where asked for."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float

from geomotion.planning.carrying import Offsets, of_vectors, vectors
from geomotion.planning.registration import register
from geomotion.scores.paths import PosePath
from geomotion.types import Tensor


@dataclass(frozen=True)
class PoseGeometry:
    """Place and size of demonstrated poses.

    Attributes:
        orientation_dim: 4 for quaternions, 3 for directions.
        centre_m: Mean position.
        scale_m: Root mean square distance to it: one scale for all axes.
    """

    orientation_dim: int
    centre_m: tuple[float, ...]
    scale_m: float

    @classmethod
    def of(cls, paths: Sequence[PosePath]) -> "PoseGeometry":
        """Measure demonstrations."""
        positions = np.concatenate([path.position_m for path in paths])
        centre = positions.mean(axis=0)
        scale = float(np.sqrt(np.square(positions - centre).sum(axis=1).mean()))
        return cls(paths[0].orientation.shape[1], tuple(centre.tolist()), scale)

    @property
    def position_dim(self) -> int:
        """Dx."""
        return len(self.centre_m)

    def scaled(self, path: PosePath) -> Float[np.ndarray, "pose D"]:
        """Poses as the network sees them."""
        return np.concatenate([(path.position_m - self.centre_m) / self.scale_m, path.orientation], axis=1)


@dataclass(frozen=True)
class PoseTrainingSet:
    """What a manifold is fitted to.

    Attributes:
        geometry: Place and size.
        groups: Number of the group of each demonstration.
        originals: Demonstrations as they are.
        paths: Demonstrations, carried to the mean start and goal of their group if asked for.
        progress: Share of the motion that is done at each of their poses.
    """

    geometry: PoseGeometry
    groups: tuple[int, ...]
    originals: tuple[PosePath, ...]
    paths: tuple[PosePath, ...]
    progress: tuple[Float[np.ndarray, " pose"], ...]

    @classmethod
    def of(cls, paths: Sequence[PosePath], groups: Sequence[str], carry: bool) -> "PoseTrainingSet":
        """Register demonstrations to each other within their groups.

        Args:
            paths: Demonstrations with equal numbers of poses, even in time.
            groups: Name of the group of each one.
            carry: Whether to carry each one to the mean start and goal of its group.
        """
        geometry = PoseGeometry.of(paths)
        names = list(dict.fromkeys(groups))
        numbers = tuple(names.index(group) for group in groups)
        progress: dict[int, Float[np.ndarray, " pose"]] = {}
        carried: dict[int, PosePath] = dict(enumerate(paths))
        for group in range(len(names)):
            members = [number for number, own in enumerate(numbers) if own == group]
            progress |= dict(zip(members, register([geometry.scaled(paths[one]) for one in members]), strict=True))
            if carry:
                ends = _mean_ends([paths[one] for one in members])
                carried |= {one: _carried(paths[one], progress[one], ends) for one in members}
        order = range(len(paths))
        shares = tuple(progress[one] for one in order)
        return cls(geometry, numbers, tuple(paths), tuple(carried[one] for one in order), shares)

    def tensors(self, mixed_copies: int, doubled: bool, seed: int) -> tuple[Tensor, Tensor]:
        """Poses and progress of all demonstrations as single-precision tensors, shapes (point, D) and (point,).

        Args:
            mixed_copies: For each demonstration, how many mixtures of two of its group are added.
            doubled: Whether every pose comes a second time with -q.
            seed: Of the mixtures.
        """
        mixtures = self.mixtures(mixed_copies, seed)
        poses = np.concatenate([self.geometry.scaled(path) for path in (*self.paths, *(one.path for one in mixtures))])
        progress = np.concatenate([*self.progress, *(one.progress for one in mixtures)])
        if doubled:
            signs = np.concatenate([np.ones(self.geometry.position_dim), -np.ones(self.geometry.orientation_dim)])
            poses, progress = np.concatenate([poses, poses * signs]), np.concatenate([progress, progress])
        return torch.as_tensor(poses, dtype=torch.float32), torch.as_tensor(progress, dtype=torch.float32)

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
                theirs = vectors(self.paths[other]).T
                matched = np.stack(
                    [np.interp(self.progress[one], self.progress[other], axis) for axis in theirs], axis=1
                )
                mixed = of_vectors((1 - share) * vectors(path) + share * matched, self.geometry.position_dim)
                found.append(Mixture(mixed, self.progress[one], self.groups[one]))
        return found


@dataclass(frozen=True)
class Mixture:
    """What lies between two demonstrations.

    Attributes:
        path: Poses.
        progress: At each.
        group: Of both.
    """

    path: PosePath
    progress: Float[np.ndarray, " pose"]
    group: int


def _mean_ends(paths: Sequence[PosePath]) -> PosePath:
    ends = np.mean([vectors(path)[[0, -1]] for path in paths], axis=0)
    return of_vectors(ends, paths[0].position_m.shape[1])


def _carried(path: PosePath, progress: Float[np.ndarray, " pose"], ends: PosePath) -> PosePath:
    return Offsets.between(path, ends, progress).carry(path, progress)
