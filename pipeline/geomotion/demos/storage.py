"""Demonstrations on disk: parquet and JSON in the layout of LeRobot datasets, version 3.

``data/`` holds one row per sample: the channels side by side in ``observation.state``, their velocities in ``action``,
and the time stamps, all in float64. ``meta/`` holds the episodes with their labels, and ``info.json``, which is written
last: it names the channels, says where the recordings come from, and carries the digests of the other files.
"""

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geomotion.demos.columns import column_names
from geomotion.demos.demonstrations import VELOCITY_OF, Array, Demonstrations, Trajectory
from geomotion.errors import CorruptArtefact, MissingData
from geomotion.files import atomic, read_json, write_json

if TYPE_CHECKING:
    import pyarrow as pa

DATA = "data/chunk-000/file-000.parquet"
EPISODES = "meta/episodes/chunk-000/file-000.parquet"
TASKS = "meta/tasks.parquet"
INFO = "meta/info.json"
CONDITION = "condition"  # column of the episodes
OWN_KEY = "geomotion"  # entry of info.json that other tools ignore
COLUMN_OF_CHANNELS = {"observation.state": False, "action": True}  # whether a column holds velocities


def save(demonstrations: Demonstrations, folder: Path) -> str:
    """Write `demonstrations` to `folder`; :func:`load` gives back every bit.

    An earlier dataset there is replaced. Interrupted, it leaves no ``info.json``, and hence no dataset.

    Returns:
        SHA-256 of the samples.

    Raises:
        DiskFull: If space ran out.
    """
    (folder / INFO).unlink(missing_ok=True)
    _write_table(_samples(demonstrations), folder / DATA)
    _write_table(_episodes(demonstrations), folder / EPISODES)
    _write_tasks(demonstrations, folder / TASKS)
    write_json(folder / INFO, _info(demonstrations, folder))
    return _digest(folder / DATA)


def load(folder: Path) -> Demonstrations:
    """Read what :func:`save` wrote.

    Raises:
        MissingData: If there is no dataset in `folder`.
        CorruptArtefact: If a file is missing, damaged, or not the one that was written.
    """
    if not (folder / INFO).is_file():
        raise MissingData(f"dataset {folder}", f"It has no {INFO}; repeat the stage that writes it.")
    info = read_json(folder / INFO)
    try:
        own = info[OWN_KEY]
        for name, digest in own["sha256"].items():
            _verify(folder / name, digest)
        samples, episodes = _read_table(folder / DATA), _read_table(folder / EPISODES)
        return Demonstrations(
            name=own["name"],
            trajectories=tuple(_trajectories(samples, episodes, own["channels"])),
            space=own["space"],
            frame=own["frame"],
            source=own["source"],
            licence=own["licence"],
            steps=tuple(own["steps"]),
            joint_names=tuple(own.get("joint_names", ())),  # sets written before names were kept have none
            condition_names=tuple(own.get("condition_names", ())),
        )
    except (KeyError, TypeError, AttributeError) as error:
        raise CorruptArtefact(folder / INFO, f"lacks what a dataset of this program has ({error})") from error


def _channels(demonstrations: Demonstrations, velocities: bool) -> list[str]:
    return [name for name in demonstrations.channel_names if (name in VELOCITY_OF.values()) == velocities]


def _samples(demonstrations: Demonstrations) -> "pa.Table":
    import pyarrow as pa

    lengths = [len(trajectory) for trajectory in demonstrations.trajectories]
    columns: dict[str, Any] = {}
    for column, velocities in COLUMN_OF_CHANNELS.items():
        if names := _channels(demonstrations, velocities):
            values = np.concatenate([trajectory.state(names) for trajectory in demonstrations.trajectories])
            columns[column] = pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), values.shape[1])
    columns["timestamp"] = np.concatenate([trajectory.time_s for trajectory in demonstrations.trajectories])
    columns["frame_index"] = np.concatenate([np.arange(length) for length in lengths])
    columns["episode_index"] = np.repeat(np.arange(len(lengths)), lengths)
    columns["index"] = np.arange(sum(lengths))
    columns["task_index"] = np.zeros(sum(lengths), dtype=np.int64)
    return pa.table(columns)


def _episodes(demonstrations: Demonstrations) -> "pa.Table":
    import pyarrow as pa

    ends = np.cumsum([len(trajectory) for trajectory in demonstrations.trajectories])
    count = len(demonstrations)
    first_file = ("data/chunk_index", "data/file_index", "meta/episodes/chunk_index", "meta/episodes/file_index")
    return pa.table(
        {
            "episode_index": np.arange(count),
            "tasks": [[demonstrations.name]] * count,
            "label": [trajectory.label for trajectory in demonstrations.trajectories],
            "length": np.diff(ends, prepend=0),
            "dataset_from_index": np.concatenate([[0], ends[:-1]]),
            "dataset_to_index": ends,
            **{column: np.zeros(count, dtype=np.int64) for column in first_file},
            **_conditions(demonstrations),
        }
    )


def _conditions(demonstrations: Demonstrations) -> dict[str, Any]:
    import pyarrow as pa

    if not demonstrations.condition_names:
        return {}
    values = [list(trajectory.condition) for trajectory in demonstrations.trajectories]
    return {CONDITION: pa.array(values, pa.list_(pa.float64()))}


def _write_tasks(demonstrations: Demonstrations, path: Path) -> None:
    import pandas as pd

    with atomic(path) as temporary:
        pd.DataFrame({"task_index": [0]}, index=pd.Index([demonstrations.name], name="task")).to_parquet(temporary)


def _info(demonstrations: Demonstrations, folder: Path) -> dict[str, Any]:
    description = demonstrations.description()
    widths = description["channels"]
    features: dict[str, Any] = {}
    for column, velocities in COLUMN_OF_CHANNELS.items():
        names = [axis for name in _channels(demonstrations, velocities) for axis in column_names(name, widths[name])]
        if names:
            features[column] = {"dtype": "float64", "shape": [len(names)], "names": names}
    features["timestamp"] = {"dtype": "float64", "shape": [1], "names": None}
    for column in ("frame_index", "episode_index", "index", "task_index"):
        features[column] = {"dtype": "int64", "shape": [1], "names": None}
    return {
        "codebase_version": "v3.0",
        "robot_type": None,
        "total_episodes": len(demonstrations),
        "total_frames": sum(len(trajectory) for trajectory in demonstrations.trajectories),
        "total_tasks": 1,
        "chunks_size": 1000,
        "fps": _nominal_rate_hz(demonstrations),
        "splits": {"train": f"0:{len(demonstrations)}"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": None,
        "features": features,
        OWN_KEY: {
            **description,
            "sha256": {name: _digest(folder / name) for name in (DATA, EPISODES)},
        },
    }


def _nominal_rate_hz(demonstrations: Demonstrations) -> int:
    """Mean samples per second, which LeRobot wants as an integer; the time stamps are what counts."""
    steps = sum(len(trajectory) - 1 for trajectory in demonstrations.trajectories)
    return max(1, round(steps / sum(trajectory.duration_s for trajectory in demonstrations.trajectories)))


def _trajectories(samples: "pa.Table", episodes: "pa.Table", widths: dict[str, int]) -> list[Trajectory]:
    values: dict[str, Array] = {}
    for column, velocities in COLUMN_OF_CHANNELS.items():
        names = [name for name in widths if (name in VELOCITY_OF.values()) == velocities]
        if names:
            side_by_side = samples[column].combine_chunks().flatten().to_numpy().reshape(samples.num_rows, -1)
            splits = np.cumsum([widths[name] for name in names])[:-1]
            values |= dict(zip(names, np.split(side_by_side, splits, axis=1), strict=True))
    time_s = samples["timestamp"].to_numpy()
    bounds = zip(episodes["dataset_from_index"].to_pylist(), episodes["dataset_to_index"].to_pylist(), strict=True)
    has_conditions = CONDITION in episodes.column_names
    conditions = episodes[CONDITION].to_pylist() if has_conditions else [()] * episodes.num_rows
    return [
        Trajectory(time_s[begin:end], {name: values[name][begin:end] for name in widths}, label, tuple(condition))
        for (begin, end), label, condition in zip(bounds, episodes["label"].to_pylist(), conditions, strict=True)
    ]


def _write_table(table: "pa.Table", path: Path) -> None:
    import pyarrow.parquet as pq

    with atomic(path) as temporary:
        pq.write_table(table, temporary)


def _read_table(path: Path) -> "pa.Table":
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        return file.read()


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _verify(path: Path, digest: str) -> None:
    if not path.is_file():
        raise CorruptArtefact(path, "the file is missing")
    if _digest(path) != digest:
        raise CorruptArtefact(path, "its contents are not those that were written")
