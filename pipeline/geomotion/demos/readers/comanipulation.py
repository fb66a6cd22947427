"""Symbols drawn on a table with a Franka Panda that people led by hand (Panda Co-Manipulation Dataset).

Recorded are positions alone. The orientation is derived: the hand points down and faces the direction of motion, as in
the second panel of Thesis Fig. 6.13, whose recordings are not public.
"""

from pathlib import Path

import numpy as np

from geomotion.config import CoManipulationDataset
from geomotion.demos.demonstrations import Array, Demonstrations, Trajectory, validate
from geomotion.demos.orientations import continuous_in_sign
from geomotion.demos.readers.downloads import recording
from geomotion.errors import DatasetError

FOLDER_VARIABLE = "COMANIPULATION_DATA_DIR"
COMMIT = "ff7ba9eef7921a252aed1ea6891be8c922c713c1"
FOLDER_URL = (
    f"https://raw.githubusercontent.com/AutoLabModena/Panda-Co-Manipulation-Dataset/{COMMIT}/Panda_CoManipulation_Data"
)
FILE = "symbol_data.mat"
SHA256 = {17: "349182d62d00af383773557dc7963a658e2feed3b83aceee721342137e330864"}
SOURCE = (
    "Panda Co-Manipulation Dataset: G. Braglia, D. Tebaldi, A. E. Lazzaretti, L. Biagiotti, Arc-Length-Based Warping "
    "for Robot Skill Synthesis from Multiple Demonstrations, arXiv 2410.13322"
)
SMOOTHING_S = 0.1  # Savitzky-Golay window of positions, order 3, before speeds are taken
FACING_M = 0.015  # the direction is that between places so far behind and ahead
MOVING_POINTS = 50  # fewer are no motion


def read(config: CoManipulationDataset) -> Demonstrations:
    """Read the strokes of one symbol: ``position_m`` [m], and ``orientation_wxyz``, derived.

    Raises:
        MissingData: If the file is missing and cannot be downloaded.
        DatasetError: If it is damaged, or not what was published.
    """
    path = _find(config)
    strokes = [_stroke(position, config, path, number) for number, position in enumerate(_load(path))]
    validate(str(path), strokes)
    return Demonstrations(
        name=config.name,
        trajectories=tuple(strokes),
        space="R3xS3",
        frame="robot base",
        source=f"{SOURCE}; symbol {config.symbol}",
        licence="MIT, copyright 2024 AutoLabModena",
        steps=(
            f"cut out where the hand rests, slower than {config.rest_speed_m_per_s:g} m/s, and joined the rest in time",
            f"took {config.points} points of each recording, even in time",
            f"derived orientation_wxyz: hand down, facing the direction of motion over {2 * FACING_M:g} m",
        ),
    )


def facing(position_m: Array, reach_m: float = FACING_M) -> Array:
    """Orientation of a hand that points down and faces where it goes, wxyz.

    Its x axis is along the horizontal direction from `reach_m` behind on the way to `reach_m` ahead, less at the ends.

    Args:
        position_m: A path, shape (time, 3) [m].
        reach_m: Positive [m].
    """
    from scipy.spatial.transform import Rotation

    passed = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position_m, axis=0), axis=1))])
    behind, ahead = (_at(passed + step, passed, position_m) for step in (-reach_m, reach_m))
    yaw = np.unwrap(np.arctan2(*(ahead - behind)[:, 1::-1].T))
    down = Rotation.from_rotvec([np.pi, 0.0, 0.0])
    wxyz = (Rotation.from_rotvec(np.outer(yaw, [0.0, 0.0, 1.0])) * down).as_quat(scalar_first=True)
    return continuous_in_sign(wxyz, wxyz[0])


def _stroke(recorded_m: Array, config: CoManipulationDataset, path: Path, number: int) -> Trajectory:
    from scipy.signal import savgol_filter

    window = 2 * round(SMOOTHING_S * config.sampling_rate_hz / 2) + 1
    if len(recorded_m) < window:
        raise DatasetError(path, f"demonstration {number} has {len(recorded_m)} samples; expected {window} or more")
    smooth, velocity = (
        savgol_filter(recorded_m, window, 3, deriv=order, delta=1 / config.sampling_rate_hz, axis=0) for order in (0, 1)
    )
    moving = smooth[np.linalg.norm(velocity, axis=1) >= config.rest_speed_m_per_s]
    if len(moving) < MOVING_POINTS:
        raise DatasetError(
            path, f"demonstration {number} rests but for {len(moving)} samples; lower dataset.rest_speed_m_per_s"
        )
    recorded_s = np.arange(len(moving)) / config.sampling_rate_hz
    time_s = np.linspace(0.0, recorded_s[-1], config.points)
    position_m = _at(time_s, recorded_s, moving)
    return Trajectory(time_s, {"position_m": position_m, "orientation_wxyz": facing(position_m)})


def _load(path: Path) -> list[Array]:
    """Recorded positions of each demonstration, each of shape (time, 3) [m]."""
    from scipy.io import loadmat

    try:
        found = loadmat(path, squeeze_me=True, struct_as_record=False)["symbol_data"]
        positions = [np.asarray(one.pos, dtype=np.float64).T for one in np.atleast_1d(found)]
    except KeyError as error:
        raise DatasetError(path, "has no symbol_data; is it a file of this set?") from error
    except (OSError, ValueError, TypeError, AttributeError, NotImplementedError) as error:
        raise DatasetError(path, "not a MATLAB file of this set, or truncated; delete it and get it again") from error
    for number, position in enumerate(positions):
        if position.ndim != 2 or position.shape[1] != 3:
            raise DatasetError(path, f"demonstration {number}: pos has shape {position.T.shape}; expected (3, time)")
    return positions


def _find(config: CoManipulationDataset) -> Path:
    place = f"{config.symbol}/{FILE}"
    what = f"symbol {config.symbol} of the Panda Co-Manipulation Dataset"
    sha256 = SHA256.get(config.symbol)
    return recording(config.root, FOLDER_VARIABLE, f"{FOLDER_URL}/{place}", sha256, f"comanipulation/{place}", what)


def _at(now: Array, known: Array, values: Array) -> Array:
    return np.stack([np.interp(now, known, axis) for axis in values.T], axis=1)
