"""RoboTasks9: end-effector poses of a Franka Panda, taught by hand, nine demonstrations a task."""

from pathlib import Path

import numpy as np

from geomotion.config import RoboTasks9Dataset
from geomotion.demos.demonstrations import Array, Demonstrations, Trajectory, validate
from geomotion.demos.readers.downloads import recording
from geomotion.errors import DatasetError

METRES_PER_UNIT = 1e-2  # the source states no unit; centimetres put every pose within the Panda's reach
FOLDER_VARIABLE = "ROBOTASKS9_DATA_DIR"
COMMIT = "cf610acbaa8264d9d39df44439d8d7377e689009"
FOLDER_URL = f"https://raw.githubusercontent.com/sayantanauddy/clfd-snode/{COMMIT}/datasets/robottasks/pos_ori"
SHA256 = {
    "bottle2shelf": "4866e529c32a3ed764096e33105a03aa66525e232d03e7c436559f499f3ae596",
    "matfolding": "b329e821ad21ae8df581417ca9784f32f81c617d1c9cbdf73148f425d24c1f59",
    "openbox": "22c56b8ec0c0c7ae27f1ebbd388567ff006156c67476c238860fa3704ab8834f",
    "pouring": "99ed10bb456f3ecca4ae1efe5503a3c46eb23f1526ef66f1c9fcc411be558fa8",
    "scoop": "670071accdb9c4c80d35762ee20f1180cc8095845ee6d7c9745d20c876c46f55",
    "wineglass": "ad56e3607934bded85dc57c241bd50aba80fc66809cb6e5e54a09950a397ab92",
}
SOURCE = (
    "RoboTasks9: S. Auddy, J. Hollenstein, M. Saveriano, A. Rodriguez-Sanchez, J. Piater, Scalable and Efficient "
    "Continual Learning from Demonstration via a Hypernetwork-generated Stable Dynamics Model, arXiv 2311.03600"
)


def read(config: RoboTasks9Dataset) -> Demonstrations:
    """Read the poses of one task: ``position_m`` [m] and ``orientation_wxyz``, at a nominal rate [Hz].

    Raises:
        MissingData: If the file is missing and cannot be downloaded.
        DatasetError: If it is damaged, or not what was published.
    """
    path = _find(config)
    poses = _load(path)
    time_s = np.arange(poses.shape[1]) / config.sampling_rate_hz
    trajectories = tuple(
        Trajectory(time_s, {"position_m": METRES_PER_UNIT * pose[:, :3], "orientation_wxyz": pose[:, 3:]})
        for pose in poses
    )
    validate(str(path), trajectories)
    return Demonstrations(
        name=config.name,
        trajectories=trajectories,
        space="R3xS3",
        frame="robot base",
        source=f"{SOURCE}; task {config.task}",
        licence="MIT, copyright 2023 Sayantan Auddy",
    )


def _load(path: Path) -> Array:
    """Poses ``px, py, pz, qw, qx, qy, qz`` in the source's unit, shape (demo, time, 7)."""
    try:
        poses = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise DatasetError(path, "not a .npy file of numbers, or truncated; delete it and get it again") from error
    if poses.ndim != 3 or poses.shape[2] != 7:
        raise DatasetError(path, f"holds an array of shape {poses.shape}; expected (demo, time, 7)")
    return np.asarray(poses, dtype=np.float64)


def _find(config: RoboTasks9Dataset) -> Path:
    name = f"{config.task}.npy"
    what = f"RoboTasks9 task {config.task!r}"
    sha256 = SHA256.get(config.task)
    return recording(config.root, FOLDER_VARIABLE, f"{FOLDER_URL}/{name}", sha256, f"robotasks9/{name}", what)
