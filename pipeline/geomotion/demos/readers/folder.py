"""A user's own recordings: a folder of CSV, NPZ or parquet files, or a dataset in the layout of ``demos.storage``.

The schema of columns and arrays is described in docs/data.md.
"""

import json
import os
from pathlib import Path

from geomotion.config import FolderDataset
from geomotion.demos import storage
from geomotion.demos.columns import space_of
from geomotion.demos.demonstrations import Demonstrations, Trajectory, validate
from geomotion.demos.readers.tables import TABLE_READERS, read_episodes
from geomotion.demos.readers.trajectories import trajectories_of
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
    trajectories = [trajectory for path in _recordings(root) for trajectory in _read_file(path, config)]
    return _assemble(root, config, trajectories)


def _recordings(root: Path) -> list[Path]:
    paths = [path for path in root.iterdir() if path.suffix.lower() in TABLE_READERS and not path.name.startswith(".")]
    if not paths:
        suffixes = ", ".join(TABLE_READERS)
        raise DatasetError(root, f"holds no recording; expected files ending in {suffixes}, or {storage.INFO}")
    return sorted(paths)


def _read_file(path: Path, config: FolderDataset) -> list[Trajectory]:
    table = TABLE_READERS[path.suffix.lower()](path)
    trajectories = trajectories_of(table, path, config)
    validate(str(path), trajectories)
    return trajectories


def _read_dataset(root: Path, config: FolderDataset) -> Demonstrations:
    """One of ours, exactly; somebody else's LeRobot dataset through its column names."""
    try:
        info = json.loads((root / storage.INFO).read_text(encoding="utf-8"))
    except ValueError as error:
        raise DatasetError(root / storage.INFO, f"not a JSON document ({error})") from error
    if storage.OWN_KEY in info:
        return storage.load(root)
    return _assemble(root, config, trajectories_of(read_episodes(root, info), root, config))


def _assemble(root: Path, config: FolderDataset, trajectories: list[Trajectory]) -> Demonstrations:
    validate(str(root), trajectories)
    return Demonstrations(
        name=config.name,
        trajectories=tuple(trajectories),
        space=space_of(dict(trajectories[0].channels)),
        source=f"recordings in {root.name}",
    )
