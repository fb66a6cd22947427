"""Files as tables: a mapping from column names to one value per row."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from geomotion.demos.columns import DEMO_COLUMNS, SCALAR_LAST, TIME_COLUMNS, column_names
from geomotion.demos.demonstrations import CHANNEL_UNITS, UNIT_AXES
from geomotion.errors import DatasetError

Table = Mapping[str, NDArray[Any]]


def read_csv(path: Path) -> Table:
    """Read comma-separated values with a header line."""
    import pandas as pd

    try:
        frame = pd.read_csv(path, skipinitialspace=True)
    except (pd.errors.EmptyDataError, pd.errors.ParserError, UnicodeDecodeError, OSError) as error:
        raise DatasetError(path, f"not a CSV file with one header line ({_one_line(error)})") from error
    return {str(name): frame[name].to_numpy() for name in frame.columns}


def read_parquet(path: Path) -> Table:
    """Read a parquet file; columns of lists become one column per axis."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(path) as file:
            table = file.read()
    except (pa.ArrowInvalid, OSError) as error:
        raise DatasetError(path, f"not a parquet file, or truncated ({_one_line(error)})") from error
    columns: dict[str, NDArray[Any]] = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        if pa.types.is_list(column.type) or pa.types.is_fixed_size_list(column.type):
            columns |= _split_axes(path, name, _rows_of(path, name, column))
        else:
            columns[name] = column.to_numpy()
    return columns


def read_npz(path: Path) -> Table:
    """Read named arrays: columns (time,), channels (time, axes), or several demonstrations (demo, time, axes)."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except (OSError, ValueError, EOFError, BadZipFile) as error:
        raise DatasetError(path, f"not an NPZ file of numbers, or truncated ({_one_line(error)})") from error
    if any(values.ndim == 3 for values in arrays.values()):
        arrays = _flatten_demonstrations(path, arrays)
    columns: dict[str, NDArray[Any]] = {}
    for name, values in arrays.items():
        columns |= {name: values} if values.ndim == 1 else _split_axes(path, name, values)
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        raise DatasetError(path, f"arrays of different length {lengths}; expected one row per time")
    return columns


TABLE_READERS: dict[str, Callable[[Path], Table]] = {".csv": read_csv, ".npz": read_npz, ".parquet": read_parquet}


def read_episodes(root: Path, info: Mapping[str, Any]) -> Table:
    """Read a LeRobot-style dataset: times, episodes, and the axes of ``observation.state`` under their names.

    Raises:
        DatasetError: If there are no data files, or one of them cannot be read.
    """
    paths = sorted((root / "data").rglob("*.parquet"))
    if not paths:
        raise DatasetError(root, "holds no data/**/*.parquet; expected a LeRobot-style dataset")
    tables = [read_parquet(path) for path in paths]
    state = [name for name in tables[0] if name.startswith("observation.state")]
    kept = [name for name in tables[0] if name in (*TIME_COLUMNS, *DEMO_COLUMNS)]
    table = {name: np.concatenate([part[name] for part in tables]) for name in (*kept, *state)}
    axes = info.get("features", {}).get("observation.state", {}).get("names") or list("xyz")[: len(state)]
    if not isinstance(axes, list) or len(axes) != len(state):
        expected = f"expected a list of {len(state)} names in meta/info.json, one for each axis"
        raise DatasetError(root, f"observation.state is named {axes}; {expected}")
    for old, new in zip(state, axes, strict=True):
        table[new] = table.pop(old)
    return table


def _rows_of(path: Path, name: str, lists: Any) -> NDArray[Any]:
    """A parquet column of lists as an array (row, axis)."""
    import pyarrow.compute as pc

    widths = pc.list_value_length(lists).unique().to_pylist()
    if len(widths) != 1 or not widths[0]:
        raise DatasetError(path, f"{name} holds lists of {widths} entries; expected the same number in every row")
    flat = lists.combine_chunks().flatten().to_numpy(zero_copy_only=False)
    return np.asarray(flat).reshape(-1, widths[0])


def _flatten_demonstrations(path: Path, arrays: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Put demonstrations below each other and number them in a column."""
    demos, points = next(values.shape[:2] for values in arrays.values() if values.ndim == 3)
    flat: dict[str, NDArray[Any]] = {DEMO_COLUMNS[0]: np.repeat(np.arange(demos), points)}
    for name, values in arrays.items():
        if values.ndim == 1 and len(values) == points:
            flat[name] = np.tile(values, demos)
        elif values.shape[:2] == (demos, points):
            flat[name] = values.reshape(demos * points, *values.shape[2:])
        else:
            expected = f"({points},) or ({demos}, {points}, …)"
            raise DatasetError(path, f"{name} has shape {values.shape}; expected {expected} like the other arrays")
    return flat


def _split_axes(path: Path, name: str, values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    if values.ndim != 2:
        raise DatasetError(
            path, f"{name} has shape {values.shape}; expected (time,), (time, axes) or (demo, time, axes)"
        )
    width = values.shape[1]
    if name == SCALAR_LAST:
        if width != 4:
            raise DatasetError(path, f"{name} has {width} axes; expected x, y, z, w")
        return {f"orientation_{axis}": values[:, number] for number, axis in enumerate("xyzw")}
    if name in UNIT_AXES and width != len(UNIT_AXES[name]):
        raise DatasetError(path, f"{name} has {width} axes; expected {', '.join(UNIT_AXES[name])}")
    axes = column_names(name, width) if name in CHANNEL_UNITS else [f"{name}_{axis}" for axis in range(width)]
    return {axis: values[:, number] for number, axis in enumerate(axes)}


def _one_line(error: Exception) -> str:
    return str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
