"""A user's own recordings: a folder of CSV, NPZ or parquet files, or a dataset in the layout of ``demos.storage``.

The schema of columns and arrays is described in docs/data.md.
"""

import json
import os
from pathlib import Path

from geomotion.config import FolderDataset
from geomotion.demos import storage
from geomotion.demos.columns import space_of
from geomotion.demos.demonstrations import Demonstrations, validate
from geomotion.demos.readers.joint_states import unrolled
from geomotion.demos.readers.tables import TABLE_READERS, read_episodes
from geomotion.demos.readers.trajectories import Recording, recording_of
from geomotion.errors import DatasetError, MissingData


def read(config: FolderDataset) -> Demonstrations:
    """Read every recording of a folder in the order of the file names [m, rad, s].

    Raises:
        MissingData: If there is no such folder.
        DatasetError: If it holds no recording, or one that breaks a rule.
    """
    root = Path(config.root).expanduser()
    if not root.is_dir():
        what = "is a file" if root.exists() else "does not exist"
        raise MissingData(f"folder {root}", f"It {what}; set dataset.root= to the folder of your recordings.")
    if not os.access(root, os.R_OK | os.X_OK):
        raise DatasetError(root, "this folder cannot be read: permission denied")
    if (root / storage.INFO).is_file():
        return _read_dataset(root, config)
    recordings = {path.name: _read_file(path, config) for path in _recordings(root)}
    return _assemble(root, config, recordings)


def _recordings(root: Path) -> list[Path]:
    paths = [path for path in root.iterdir() if path.suffix.lower() in TABLE_READERS and not path.name.startswith(".")]
    if not paths:
        suffixes = ", ".join(TABLE_READERS)
        raise DatasetError(root, f"holds no recording; expected files ending in {suffixes}, or {storage.INFO}")
    return sorted(paths)


def _read_file(path: Path, config: FolderDataset) -> Recording:
    table = TABLE_READERS[path.suffix.lower()](path)
    recording = recording_of(unrolled(table, path), path, config)
    validate(str(path), recording.trajectories)
    return recording


def _read_dataset(root: Path, config: FolderDataset) -> Demonstrations:
    """One of ours, exactly; somebody else's LeRobot dataset through its column names."""
    try:
        info = json.loads((root / storage.INFO).read_text(encoding="utf-8"))
    except ValueError as error:
        raise DatasetError(root / storage.INFO, f"not a JSON document ({error})") from error
    if storage.OWN_KEY in info:
        return storage.load(root)
    return _assemble(root, config, {root.name: recording_of(read_episodes(root, info), root, config)})


def _assemble(root: Path, config: FolderDataset, recordings: dict[str, Recording]) -> Demonstrations:
    trajectories = [trajectory for recording in recordings.values() for trajectory in recording.trajectories]
    validate(str(root), trajectories)
    return Demonstrations(
        name=config.name,
        trajectories=tuple(trajectories),
        space=space_of(dict(trajectories[0].channels)),
        source=f"recordings in {root.name}",
        joint_names=_same_names(
            root, "joints", {file: recording.joint_names for file, recording in recordings.items()}
        ),
        condition_names=_same_names(
            root, "conditions", {file: recording.condition_names for file, recording in recordings.items()}
        ),
    )


def _same_names(root: Path, what: str, names_in: dict[str, tuple[str, ...]]) -> tuple[str, ...]:
    """Of all files the same, so that no joint or condition is taken for another."""
    (first, names), *others = names_in.items()
    for file, found in others:
        if found != names:
            said, expected = (", ".join(known) or "none" for known in (found, names))
            raise DatasetError(
                root / file, f"names {what} {said}; expected {expected} as in {first}, in the same order"
            )
    return names
