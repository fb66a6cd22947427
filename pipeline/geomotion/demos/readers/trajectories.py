"""From a table of named columns to trajectories in SI units."""

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geomotion.config import FolderDataset
from geomotion.demos.columns import (
    ALL_COLUMNS,
    BOOKKEEPING_COLUMNS,
    CONDITION,
    DEMO_COLUMNS,
    METRES_PER,
    RADIANS_PER,
    TIME_COLUMNS,
    Column,
    joint_names,
    parse,
    sorted_axes,
)
from geomotion.demos.demonstrations import UNIT_AXES, VELOCITY_OF, Array, Trajectory
from geomotion.demos.readers.tables import Table
from geomotion.errors import DatasetError

JOINTS = "joints_rad"


@dataclass(frozen=True)
class Recording:
    """What one file holds: demonstrations, and names of joints and conditions (empty where the file names none)."""

    trajectories: list[Trajectory]
    joint_names: tuple[str, ...]
    condition_names: tuple[str, ...] = ()


def recording_of(table: Table, path: Path, config: FolderDataset) -> Recording:
    """Translate columns to channels [m, rad] and split the rows into demonstrations.

    Args:
        table: Columns by name, one value per row.
        path: Where they come from, for messages and labels.
        config: Gives the units that columns do not name, names of joint columns, and the rate of recordings without
            time stamps.

    Raises:
        DatasetError: If a column is unknown, doubled, missing or not numeric, or a condition changes on the way.
    """
    known = {name: column for name in table if (column := _parse(name, config))}
    _refuse_unknown(path, set(table) - set(known) - {*TIME_COLUMNS, *DEMO_COLUMNS, *BOOKKEEPING_COLUMNS})
    if not known:
        raise DatasetError(path, "holds no positions or joints; expected columns such as x, y or joint_1_rad")
    channels = {
        channel: _channel(path, channel, table, known, config)
        for channel in dict.fromkeys(column.channel for column in known.values())
    }
    conditions = channels.pop(CONDITION, None)
    if not channels:
        raise DatasetError(path, "holds conditions and nothing that moves; expected positions or joints beside them")
    _refuse_unpaired_velocities(path, known)
    demo_column = _only(path, table, DEMO_COLUMNS)
    time_column = _only(path, table, TIME_COLUMNS)
    count = len(next(iter(channels.values())))
    groups = _groups(table[demo_column]) if demo_column else [(path.stem, np.arange(count))]
    trajectories = [
        Trajectory(
            time_s=_times(path, table, time_column, rows, config.sampling_rate_hz),
            channels={name: values[rows] for name, values in channels.items()},
            label=label,
            condition=() if conditions is None else _constant(path, label, conditions[rows]),
        )
        for label, rows in groups
    ]
    joints, names = (
        [column.axis for column in known.values() if column.channel == channel] for channel in (JOINTS, CONDITION)
    )
    return Recording(trajectories, joint_names(joints), tuple(sorted_axes(names)))


def _constant(path: Path, label: str, conditions: Array) -> tuple[float, ...]:
    """The condition of a demonstration, from one for each of its rows."""
    differs = ~(conditions == conditions[0]).all(axis=1)
    if differs.any():
        row = int(np.flatnonzero(differs)[0])
        found = f"{conditions[row].tolist()} after {conditions[0].tolist()}"
        raise DatasetError(
            path, f"demonstration {label}, row {row}: condition is {found}; expected one condition for all its rows"
        )
    return tuple(conditions[0].tolist())


def _parse(name: str, config: FolderDataset) -> Column | None:
    return Column(JOINTS, name, None) if name in config.joint_columns else parse(name)


def _channel(path: Path, channel: str, table: Table, known: dict[str, Column], config: FolderDataset) -> Array:
    """Values of a channel in SI units, shape (row, axis)."""
    names: dict[str, str] = {}
    for name, column in known.items():
        if column.channel == channel:
            if column.axis in names:
                raise DatasetError(path, f"{name} and {names[column.axis]} are the same axis; keep one of them")
            names[column.axis] = name
    columns = [names[axis] for axis in sorted_axes(names)]
    values = np.stack([_numbers(path, name, table[name]) for name in columns], axis=1)
    if channel in UNIT_AXES:
        _require_all_axes(path, channel, names)
    units = [known[name].unit for name in columns]
    if channel in ("position_m", "velocity_m_per_s"):
        return np.asarray(values * [METRES_PER[unit or config.length_unit.value] for unit in units])
    if channel in (JOINTS, VELOCITY_OF[JOINTS]):
        return np.asarray(values * [RADIANS_PER[unit or config.angle_unit.value] for unit in units])
    return values


def _require_all_axes(path: Path, channel: str, axes: Iterable[str]) -> None:
    if set(axes) != set(UNIT_AXES[channel]):
        what, expected = channel.partition("_")[0], ", ".join(UNIT_AXES[channel])
        raise DatasetError(path, f"{what} has axes {', '.join(sorted(axes))}; expected {expected}")


def _numbers(path: Path, name: str, values: NDArray[Any]) -> Array:
    if values.dtype.kind in "Mmc":  # dates, durations and complex numbers would be cast without a word
        raise DatasetError(path, f"{name} holds {values.dtype}; expected numbers in the unit of the column")
    try:
        return np.asarray(values, dtype=np.float64)
    except (ValueError, TypeError) as error:
        row = next(row for row, value in enumerate(values) if not _is_number(value))
        raise DatasetError(path, f"row {row}: {name} is {values[row]!r}; expected a number") from error


def _is_number(value: object) -> bool:
    try:
        float(value)  # type: ignore[arg-type]
    except (ValueError, TypeError):
        return False
    return True


def _times(path: Path, table: Table, column: str | None, rows: NDArray[np.intp], rate_hz: float | None) -> Array:
    if column:
        return _numbers(path, column, table[column])[rows]
    if rate_hz is None:
        expected = f"expected {TIME_COLUMNS[0]}, or the rate of the recording in dataset.sampling_rate_hz="
        raise DatasetError(path, f"holds no time; {expected}")
    return np.arange(len(rows)) / rate_hz


def _groups(demos: NDArray[Any]) -> list[tuple[str, NDArray[np.intp]]]:
    """Label and rows of every demonstration, in the order in which they first appear."""
    labels, first, inverse = np.unique(demos.astype(str), return_index=True, return_inverse=True)
    return [(str(labels[number]), np.flatnonzero(inverse == number)) for number in np.argsort(first)]


def _only(path: Path, table: Table, names: Iterable[str]) -> str | None:
    found = [name for name in names if name in table]
    if len(found) > 1:
        raise DatasetError(path, f"{' and '.join(found)} say the same; keep one of them")
    return found[0] if found else None


def _refuse_unknown(path: Path, names: set[str]) -> None:
    if names:
        name = min(names)
        close = get_close_matches(name.lower(), ALL_COLUMNS, n=1, cutoff=0.4)
        hint = f"did you mean {close[0]!r}? " if close else ""
        joints = "a joint of another name goes into dataset.joint_columns"
        raise DatasetError(path, f"unknown column {name!r}; {hint}docs/data.md lists the names, and {joints}")


def _refuse_unpaired_velocities(path: Path, known: dict[str, Column]) -> None:
    axes: dict[str, list[str]] = {}
    for column in known.values():
        axes.setdefault(column.channel, []).append(column.axis)
    for channel, velocity in VELOCITY_OF.items():
        if velocity in axes and sorted_axes(axes[velocity]) != sorted_axes(axes.get(channel, [])):
            expected = f"those of {channel} ({', '.join(axes.get(channel, [])) or 'absent'}), in the same order"
            raise DatasetError(path, f"{velocity} has axes {', '.join(axes[velocity])}; expected {expected}")
