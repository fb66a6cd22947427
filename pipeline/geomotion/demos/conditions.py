"""Sets of demonstrations in which a condition tells motions apart: by shape, or by target."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from geomotion.config import Condition
from geomotion.demos.demonstrations import VELOCITY_OF, Array, Demonstrations, Trajectory
from geomotion.demos.preprocessing import estimate_velocity

POSITION = "position_m"
Conditioned = tuple[list[Trajectory], tuple[str, ...]]  # trajectories, and names of the entries of their conditions


def conditioned(
    shapes: Mapping[str, Sequence[Trajectory]], condition: Condition, targets_m: Sequence[Sequence[float]] | None
) -> Conditioned:
    """The demonstrations of several shapes, or of one shape to several targets, as one set.

    Args:
        shapes: Demonstrations by the name of their shape; one shape where the condition is the target, or absent.
        condition: What tells them apart.
        targets_m: Where each demonstration is carried to; once to each target.

    Source:
        Thesis Sec. 5.5, Fig. 5.8.
    """
    if condition in (Condition.shape, Condition.label):
        return _by_shape(shapes, condition)
    (trajectories,) = shapes.values()
    if targets_m is None:
        return list(trajectories), ()
    names = tuple(f"target_{axis}_m" for axis in "xyz"[: len(targets_m[0])]) if condition is Condition.target else ()
    told = [
        replace(
            carried(trajectory, target), label=f"target {number}", condition=tuple(target.tolist()) if names else ()
        )
        for number, target in enumerate(np.array(targets_m, dtype=float), start=1)
        for trajectory in trajectories
    ]
    return told, names


def condition_names(demonstrations: Demonstrations) -> dict[str, tuple[float, ...]]:
    """What to call each condition: by the label that its demonstrations share and no others have, or by its values."""
    labels: dict[tuple[float, ...], set[str]] = {}
    for trajectory in demonstrations.trajectories:
        labels.setdefault(trajectory.condition, set()).add(trajectory.label)
    are_names = [len(found) == 1 and found != {""} for found in labels.values()]
    are_different = len(set().union(*labels.values())) == len(labels)
    if all(are_names) and are_different:
        return {found.pop(): condition for condition, found in labels.items()}
    return {
        ", ".join(
            f"{name}={value:g}" for name, value in zip(demonstrations.condition_names, condition, strict=True)
        ): condition
        for condition in labels
    }


def carried(trajectory: Trajectory, target: Array) -> Trajectory:
    """The same motion from the same start to another target [m]: the offset grows with the share of the path."""
    positions = trajectory.channels[POSITION]
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(positions, axis=0), axis=1))])
    offsets = (lengths / lengths[-1])[:, None] * (target - positions[-1])
    channels = {**trajectory.channels, POSITION: positions + offsets}
    velocity = VELOCITY_OF[POSITION]
    if velocity in channels:
        channels[velocity] = channels[velocity] + estimate_velocity(trajectory.time_s, offsets)
    return replace(trajectory, channels=channels)


def _by_shape(shapes: Mapping[str, Sequence[Trajectory]], condition: Condition) -> Conditioned:
    count = len(shapes)
    conditions = np.eye(count) if condition is Condition.shape else np.arange(count, dtype=float)[:, None]
    names = tuple(shapes) if condition is Condition.shape else ("label",)
    pairs = zip(shapes.items(), conditions, strict=True)
    return [
        replace(trajectory, label=shape, condition=tuple(row.tolist()))
        for (shape, trajectories), row in pairs
        for trajectory in trajectories
    ], names
