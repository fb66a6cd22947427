"""Logs of ``sensor_msgs/JointState`` as people export them, unrolled to one column for each joint.

Understood are: lists in a cell or in a parquet column (``name``, ``position``, ``velocity``), numbered fields
(``field.position0``, ``position_0``, ``/joint_states/position[0]``), and a column for each joint
(``/joint_states/panda_joint1/position``); clocks in nanoseconds (``%time``, ``header.stamp``), in seconds (``Time``,
``__time``), or in two parts (``secs``, ``nsecs``).
"""

import ast
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geomotion.demos.columns import DEMO_COLUMNS
from geomotion.demos.readers.tables import Table
from geomotion.errors import DatasetError

Columns = dict[str, NDArray[Any]]

FIELDS = ("name", "position", "velocity", "effort")
_LIST = re.compile(rf"(?:.*[./])?(?P<field>{'|'.join(FIELDS)})")
_NUMBERED = re.compile(rf"(?:.*[./])?(?P<field>{'|'.join(FIELDS)})[_\[]?(?P<number>\d+)\]?")
_OF_JOINT = re.compile(r".*/(?P<joint>[^/]+)/(?P<field>position|velocity|effort)")
_BOOKKEEPING = re.compile(r"(?:.*[./])?(?:seq|frame_id)")
_SECONDS = re.compile(r"(?:.*[./_])?secs?")
_NANOSECONDS = re.compile(r"(?:.*[./_])?(?:nsecs?|nanosecs?)")
_STAMPS_NS = re.compile(r"(?:.*[./])?(?:header[./_]stamp|rosbagTimestamp|%time)")
_STAMPS_S = re.compile(r"Time|__time|time|time_s|timestamp")
NANOSECOND = 1e-9


def unrolled(table: Table, path: Path) -> Table:
    """The table with columns ``time_s`` and ``joint_<name>_rad``, if it is such a log; otherwise as it is.

    Joints without names, in columns that say at least that they are of joints, are numbered from 1. Velocities are kept
    where all are recorded, efforts are not.

    Raises:
        DatasetError: If names change between rows, lists differ in length, or a cell is no list.
    """
    fields: dict[str, Columns] = {field: {} for field in FIELDS}
    rest: Columns = {}
    for column, values in _without_lists(table, path).items():
        if match := _OF_JOINT.fullmatch(column):
            fields[match["field"]][match["joint"]] = values
        elif match := _NUMBERED.fullmatch(column):
            fields[match["field"]][match["number"]] = values
        else:
            rest[column] = values
    if not fields["position"] or not (fields["name"] or any("joint" in column for column in table)):
        return table
    names = {number: _constant(path, number, values) for number, values in fields["name"].items()}
    if missing := sorted(set(names) ^ set(fields["position"])) if names else []:
        raise DatasetError(path, f"names and positions do not fit together: only one of them has {', '.join(missing)}")
    joints = {key: names.get(key) or (str(int(key) + 1) if key.isdigit() else key) for key in fields["position"]}
    found = {f"joint_{joints[key]}_rad": values for key, values in fields["position"].items()}
    if set(fields["velocity"]) == set(joints) and all(_is_complete(values) for values in fields["velocity"].values()):
        found |= {f"joint_{joints[key]}_rad_per_s": fields["velocity"][key] for key in joints}
    return (
        _clock(rest) | {name: values for name, values in rest.items() if name in DEMO_COLUMNS} | found | _others(rest)
    )


def _clock(rest: Columns) -> Columns:
    """Times from the first row on [s], from whatever clock moves; no column where there is none."""
    seconds, nanoseconds = (
        next((values for name, values in rest.items() if pattern.fullmatch(name)), None)
        for pattern in (_SECONDS, _NANOSECONDS)
    )
    if seconds is not None and nanoseconds is not None and np.ptp(seconds) + np.ptp(nanoseconds) > 0:
        return {"time_s": (seconds - seconds[0]) + NANOSECOND * (nanoseconds - nanoseconds[0])}
    for pattern, unit in ((_STAMPS_NS, NANOSECOND), (_STAMPS_S, 1.0)):
        for name, values in rest.items():
            if pattern.fullmatch(name) and np.ptp(values) > 0:
                return {"time_s": unit * (values - values[0])}
    return {}


def _others(rest: Columns) -> Columns:
    """Columns that are no part of the message, for which the schema has a name or an error."""
    of_message = (_BOOKKEEPING, _SECONDS, _NANOSECONDS, _STAMPS_NS, _STAMPS_S)
    return {
        name: values
        for name, values in rest.items()
        if name not in DEMO_COLUMNS and not any(pattern.fullmatch(name) for pattern in of_message)
    }


def _without_lists(table: Mapping[str, NDArray[Any]], path: Path) -> Columns:
    """Cells that hold lists as text, spread over numbered columns."""
    columns: Columns = {}
    for name, values in table.items():
        if _LIST.fullmatch(name) and values.dtype.kind == "O" and str(values[0]).strip()[:1] in ("[", "("):
            rows = [_list(path, name, row, cell) for row, cell in enumerate(values)]
            if len({len(row) for row in rows}) > 1:
                raise DatasetError(path, f"{name} holds lists of different lengths; expected one entry for each joint")
            columns |= {f"{name}{number}": np.array(entries) for number, entries in enumerate(zip(*rows, strict=True))}
        else:
            columns[name] = values
    return columns


def _list(path: Path, name: str, row: int, cell: object) -> list[Any]:
    try:
        return list(ast.literal_eval(str(cell)))
    except (ValueError, SyntaxError, TypeError) as error:
        raise DatasetError(path, f"row {row}: {name} is {cell!r}; expected a list, for example [0.1, 0.2]") from error


def _constant(path: Path, number: str, values: NDArray[Any]) -> str:
    found = np.unique(values.astype(str))
    if len(found) > 1:
        raise DatasetError(path, f"joint {number} is named {' and '.join(found[:2])}; expected one name in all rows")
    return str(found[0]).strip().strip("'\"")


def _is_complete(values: NDArray[Any]) -> bool:
    return values.dtype.kind in "fiu" and bool(np.isfinite(values).all())
