"""The one data type for recordings: trajectories with time and named channels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geomotion.errors import DatasetError, ShapeMismatch, UnknownName

Array = NDArray[np.float64]

CHANNEL_UNITS = {
    "position_m": "m",
    "orientation_wxyz": "1",
    "direction_xyz": "1",
    "joints_rad": "rad",
    "velocity_m_per_s": "m/s",
    "joint_velocity_rad_per_s": "rad/s",
}
UNIT_AXES = {"orientation_wxyz": ("w", "x", "y", "z"), "direction_xyz": ("x", "y", "z")}  # channels on S³ and on S²
UNIT_NORM_TOLERANCE = {
    "orientation_wxyz": 0.5,  # the rotation is clear all the same; preprocessing mends the length and says so
    "direction_xyz": 1e-2,  # those printed with three digits still pass
}
VELOCITY_OF = {
    "position_m": "velocity_m_per_s",
    "joints_rad": "joint_velocity_rad_per_s",
    "pose_m": "pose_velocity_m_per_s",
}


@dataclass(frozen=True)
class Trajectory:
    """One demonstration.

    Attributes:
        time_s: Increasing time stamps [s], shape (time,).
        channels: Name → values, each of shape (time, axes); the unit is part of the name
            (:data:`CHANNEL_UNITS`). Quaternions are scalar-first; they and directions have unit length.
        label: Name of the demonstration or its condition.
        condition: What the motion depends on beside the state, such as an object's place; the same throughout.
    """

    time_s: Array
    channels: Mapping[str, Array]
    label: str = ""
    condition: tuple[float, ...] = ()

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def duration_s(self) -> float:
        """Time from the first to the last stamp [s]."""
        return float(self.time_s[-1] - self.time_s[0])

    def state(self, channels: Sequence[str]) -> Array:
        """The named channels side by side, shape (time, D).

        Raises:
            UnknownName: If the trajectory has no such channel.
        """
        for name in channels:
            if name not in self.channels:
                raise UnknownName("channel", name, self.channels)
        return np.concatenate([self.channels[name] for name in channels], axis=1)

    def velocity(self, channels: Sequence[str]) -> Array:
        """Time derivatives of the named channels, shape (time, D) [unit of the channel / s].

        Raises:
            UnknownName: If the trajectory has no velocities of such a channel.
        """
        return self.state([VELOCITY_OF.get(name, f"velocity of {name}") for name in channels])


@dataclass(frozen=True)
class Demonstrations:
    """Demonstrations of one skill, with where they come from and what was done to them.

    Attributes:
        name: Name of the dataset, for example ``lasa/angle``.
        trajectories: The demonstrations, in the order of the source.
        space: ``R2``, ``R3xS3``, ``joint``, …
        frame: Coordinate frame of the recordings.
        source: Where the recordings come from, with the citation.
        licence: Licence of the recordings.
        steps: Preprocessing steps, one sentence each, in order.
        joint_names: Names of the axes of ``joints_rad``; empty where they are not known.
        condition_names: Names of the entries of conditions; empty where motions depend on the state alone.
    """

    name: str
    trajectories: tuple[Trajectory, ...]
    space: str
    frame: str = "unknown"
    source: str = ""
    licence: str = ""
    steps: tuple[str, ...] = field(default=())
    joint_names: tuple[str, ...] = field(default=())
    condition_names: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        validate(self.name, self.trajectories)
        _validate_conditions(self.name, self.trajectories, self.condition_names)
        joints = self.trajectories[0].channels.get("joints_rad")
        if self.joint_names and (joints is None or joints.shape[1] != len(self.joint_names)):
            found = "no joints" if joints is None else f"{joints.shape[1]} joints"
            raise DatasetError(self.name, f"holds {found}; expected one for each of {', '.join(self.joint_names)}")

    def __len__(self) -> int:
        return len(self.trajectories)

    def __getitem__(self, index: int) -> Trajectory:
        return self.trajectories[index]

    @property
    def channel_names(self) -> tuple[str, ...]:
        """Channels that every demonstration has."""
        return tuple(self.trajectories[0].channels)

    def description(self) -> dict[str, Any]:
        """Everything but the samples, as JSON types; ``channels`` says how many axes each one has."""
        return {
            "name": self.name,
            "space": self.space,
            "frame": self.frame,
            "source": self.source,
            "licence": self.licence,
            "steps": list(self.steps),
            "joint_names": list(self.joint_names),
            "condition_names": list(self.condition_names),
            "channels": {name: values.shape[1] for name, values in self.trajectories[0].channels.items()},
        }

    @property
    def groups(self) -> tuple[str, ...]:
        """Group of each demonstration: its label, where labels name groups; one for all, where each stands alone."""
        labels = [trajectory.label for trajectory in self.trajectories]
        are_groups = len(set(labels)) < len(labels)
        return tuple(labels) if are_groups else ("",) * len(labels)

    def select(self, indices: Sequence[int]) -> "Demonstrations":
        """The demonstrations with these numbers.

        Raises:
            ShapeMismatch: If a number does not exist.
        """
        missing = [index for index in indices if not 0 <= index < len(self)]
        if missing:
            raise ShapeMismatch(f"demonstrations of {self.name}", f"numbers 0 to {len(self) - 1}", missing)
        return replace(self, trajectories=tuple(self.trajectories[index] for index in indices))

    def with_step(self, trajectories: Sequence[Trajectory], step: str) -> "Demonstrations":
        """The same recordings after one more preprocessing step."""
        return replace(self, trajectories=tuple(trajectories), steps=(*self.steps, step))


def validate(name: str, trajectories: Sequence[Trajectory]) -> None:
    """Check the rules every dataset obeys.

    Raises:
        DatasetError: Naming demonstration, row and the rule broken.
    """
    if not trajectories:
        raise DatasetError(name, "holds no demonstration; expected at least one")
    widths = {channel: values.shape[1] for channel, values in trajectories[0].channels.items()}
    for number, trajectory in enumerate(trajectories):
        place = f"demonstration {number}" + (f" ({trajectory.label})" if trajectory.label else "")
        if len(trajectory) < 2:
            raise DatasetError(name, f"{place} has {len(trajectory)} point(s); expected at least 2")
        _validate_time(name, place, trajectory.time_s)
        found = {channel: values.shape[1] for channel, values in trajectory.channels.items()}
        if found != widths:
            raise DatasetError(name, f"{place} has channels {found}; expected {widths} as in demonstration 0")
        for channel, values in trajectory.channels.items():
            if len(values) != len(trajectory):
                raise DatasetError(name, f"{place}: {channel} has {len(values)} rows, time has {len(trajectory)}")
            bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
            if bad.size:
                raise DatasetError(
                    name, f"{place}, row {bad[0]}: {channel} is {values[bad[0]].tolist()}; expected finite numbers"
                )
            if channel in UNIT_AXES:
                _validate_unit(name, place, values, channel)


def _validate_conditions(name: str, trajectories: Sequence[Trajectory], names: tuple[str, ...]) -> None:
    for number, trajectory in enumerate(trajectories):
        found = trajectory.condition
        if len(found) != len(names) or not np.isfinite(found).all():
            expected = f"{len(names)} finite numbers ({', '.join(names)})" if names else "none"
            raise DatasetError(name, f"demonstration {number} has the condition {list(found)}; expected {expected}")


def _validate_unit(name: str, place: str, values: Array, channel: str) -> None:
    what, width = "quaternion" if channel == "orientation_wxyz" else "direction", len(UNIT_AXES[channel])
    if values.shape[1] != width:
        raise DatasetError(name, f"{place}: {what} with {values.shape[1]} axes; expected {width}")
    norms = np.linalg.norm(values, axis=1)
    bad = np.flatnonzero(np.abs(norms - 1) > UNIT_NORM_TOLERANCE[channel])
    if bad.size:
        raise DatasetError(name, f"{place}, row {bad[0]}: {what} of norm {norms[bad[0]]:g}; expected 1")


def _validate_time(name: str, place: str, time_s: Array) -> None:
    if not np.isfinite(time_s).all():
        row = int(np.flatnonzero(~np.isfinite(time_s))[0])
        raise DatasetError(name, f"{place}, row {row}: time is {time_s[row]}; expected finite seconds")
    steps = np.diff(time_s)
    if (steps <= 0).any():
        row = int(np.flatnonzero(steps <= 0)[0]) + 1
        what = "repeats" if steps[row - 1] == 0 else "goes back from"
        raise DatasetError(
            name, f"{place}, row {row}: time {time_s[row]:g} s {what} {time_s[row - 1]:g} s; expected increasing times"
        )
