"""Typed views of ``evaluation.npz``: what an evaluation computed, in the groups in which it is drawn."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from geomotion.errors import CorruptArtefact, MissingData

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Arrays = Mapping[str, NDArray[Any]]


@dataclass(frozen=True)
class Judged:
    """A demonstration and the rollout from its start.

    Attributes:
        time_s: Times of both [s], shape (T,).
        demonstration: Demonstrated states [m], shape (T, D).
        rollout: States of the field's trajectory [m], shape (T, D).
        held_out: Whether the demonstration was kept from training.
    """

    time_s: Array
    demonstration: Array
    rollout: Array
    held_out: bool


@dataclass(frozen=True)
class Flow:
    """Velocities on a square grid of a plane: points [m] and velocities [m/s], each of shape (k·k, 2)."""

    points: Array
    velocity: Array


@dataclass(frozen=True)
class EigenvalueGrid:
    """Largest eigenvalues [1/s] of the symmetric part of a Jacobian; negative where nearby states approach.

    Attributes:
        points: Grid states [m], shape (n, D).
        shape: Points along each axis of a planar grid; empty for scattered points.
        true: Of ∂f/∂x in the robot's coordinates, shape (n,).
        claimed: Of the true Jacobian in the coordinates where contraction is claimed, shape (n,).
        jhat: Of Ĵ, Eq. (5.1), shape (n,); None for fields without one.
        true_smallest: The smallest ones of ∂f/∂x, shape (n,); None in evaluations of earlier versions.
        jhat_smallest: The smallest ones of Ĵ, shape (n,); None for fields without one.
    """

    points: Array
    shape: tuple[int, ...]
    true: Array
    claimed: Array
    jhat: Array | None
    true_smallest: Array | None = None
    jhat_smallest: Array | None = None


@dataclass(frozen=True)
class Nearby:
    """Mean pairwise distance of trajectories that start close to each other.

    Attributes:
        time_s: Times [s], shape (T,).
        euclidean: In the robot's coordinates [m], shape (T,).
        claimed: In the metric where contraction is claimed, shape (T,).
        bound: What the certificate allows in that metric, shape (T,); None without a proven rate.
    """

    time_s: Array
    euclidean: Array
    claimed: Array
    bound: Array | None


@dataclass(frozen=True)
class Region:
    """Stay inside the convex hull of the demonstrations, Eq. (6.10).

    Attributes:
        hull: Corners [m], shape (m, 2).
        rollouts: Trajectories from an equidistant grid of starts [m], shape (rollout, T, 2).
        inside: Whether each state is inside, shape (rollout, T).
    """

    hull: Array
    rollouts: Array
    inside: Mask

    @property
    def steps_inside(self) -> NDArray[np.int64]:
        """Time steps that each rollout spends inside, shape (rollout,)."""
        return np.asarray(self.inside.sum(axis=1))


@dataclass(frozen=True)
class GoalStarts:
    """Starts on a grid [m], shape (n, D), and whether their trajectories came to the goal, shape (n,)."""

    goal: Array
    starts: Array
    reached: Mask


@dataclass(frozen=True)
class LatentPlane:
    """A plane of the latent space of a skill of few dimensions.

    Attributes:
        demonstrated: A demonstration there, shape (T, 2).
        paths: Motions from its start and from others, shape (motion, T, 2).
        points: Of a square grid, shape (k·k, 2).
        velocity: The latent field at these, per time unit.
        is_skill: Whether each of the two coordinates is one of the skill's.
    """

    demonstrated: Array
    paths: Array
    points: Array
    velocity: Array
    is_skill: tuple[bool, bool]


@dataclass(frozen=True)
class EvaluationArrays:
    """All that was computed; None where it does not apply."""

    judged: tuple[Judged, ...]
    flow: Flow | None
    eigenvalues: EigenvalueGrid | None
    nearby: Nearby | None
    region: Region | None
    goal_starts: GoalStarts | None
    latent: LatentPlane | None = None
    names: tuple[str, ...] = ()  # of the coordinates, with units; empty where they are positions [m]

    @property
    def dim(self) -> int:
        """Dimension of the state."""
        return int(self.judged[0].demonstration.shape[1])

    @property
    def extent(self) -> Array:
        """Planar states that a map has to show [m], shape (n, 2)."""
        return (
            self.flow.points if self.flow is not None else np.concatenate([item.demonstration for item in self.judged])
        )

    @property
    def has_held_out(self) -> bool:
        """Whether any judged demonstration was kept from training."""
        return any(item.held_out for item in self.judged)


def from_arrays(arrays: Arrays) -> EvaluationArrays:
    """Group the flat names of ``evaluation.npz``.

    Raises:
        MissingData: If it holds no judged demonstration.
    """
    numbers = sorted(int(name.removeprefix("demo_")) for name in arrays if name.startswith("demo_"))
    if not numbers:
        raise MissingData("a judged demonstration in evaluation.npz", "Repeat the stage: ncds eval reuse=false.")
    return EvaluationArrays(
        tuple(_judged(arrays, number) for number in numbers),
        _flow(arrays),
        _eigenvalues(arrays),
        _nearby(arrays),
        _region(arrays),
        _goal_starts(arrays),
        _latent(arrays),
        tuple(arrays["state_names"].tolist()) if _has(arrays, "state_names") else (),
    )


def read_evaluation(path: Path) -> EvaluationArrays:
    """Read ``evaluation.npz``.

    Raises:
        MissingData: If there is no such file, or it holds no judged demonstration.
        CorruptArtefact: If it cannot be read.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            return from_arrays({name: archive[name] for name in archive.files})
    except FileNotFoundError as error:
        raise MissingData(str(path), "It is written by ncds eval; repeat that stage.") from error
    except (KeyError, ValueError, EOFError, OSError, BadZipFile) as error:
        raise CorruptArtefact(path, f"not a complete evaluation ({error})") from error


def _has(arrays: Arrays, *names: str) -> bool:
    return all(name in arrays and arrays[name].size > 0 for name in names)


def _optional(arrays: Arrays, name: str) -> Array | None:
    return arrays[name] if _has(arrays, name) else None


def _judged(arrays: Arrays, number: int) -> Judged:
    time_s, demonstration, rollout, subset = (arrays[f"{name}_{number}"] for name in ("time", "demo", "rollout", "set"))
    return Judged(time_s, demonstration, rollout, str(subset) != "train")


def _flow(arrays: Arrays) -> Flow | None:
    return Flow(arrays["field_points"], arrays["field_velocity"]) if _has(arrays, "field_points") else None


def _eigenvalues(arrays: Arrays) -> EigenvalueGrid | None:
    if not _has(arrays, "grid_points", "true_eigenvalue", "claimed_eigenvalue"):
        return None
    shape = tuple(int(length) for length in arrays.get("grid_shape", np.empty(0)))
    largest = arrays["true_eigenvalue"], arrays["claimed_eigenvalue"], _optional(arrays, "jhat_eigenvalue")
    smallest = _optional(arrays, "true_smallest_eigenvalue"), _optional(arrays, "jhat_smallest_eigenvalue")
    return EigenvalueGrid(arrays["grid_points"], shape, *largest, *smallest)


def _nearby(arrays: Arrays) -> Nearby | None:
    if not _has(arrays, "nearby_time", "nearby_euclidean", "nearby_claimed"):
        return None
    return Nearby(
        arrays["nearby_time"], arrays["nearby_euclidean"], arrays["nearby_claimed"], _optional(arrays, "nearby_bound")
    )


def _region(arrays: Arrays) -> Region | None:
    if not _has(arrays, "region_hull", "region_rollouts", "region_inside"):
        return None
    return Region(arrays["region_hull"], arrays["region_rollouts"], arrays["region_inside"].astype(bool))


def _latent(arrays: Arrays) -> LatentPlane | None:
    if not _has(arrays, "latent_demonstrated", "latent_paths", "latent_points", "latent_velocity"):
        return None
    first, second = arrays["latent_is_skill"].tolist()
    shown = arrays["latent_demonstrated"], arrays["latent_paths"]
    return LatentPlane(*shown, arrays["latent_points"], arrays["latent_velocity"], (first, second))


def _goal_starts(arrays: Arrays) -> GoalStarts | None:
    if not _has(arrays, "goal", "goal_starts", "goal_reached"):
        return None
    return GoalStarts(arrays["goal"], arrays["goal_starts"], arrays["goal_reached"].astype(bool))
