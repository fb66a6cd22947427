import numpy as np
import pytest

from geomotion.config import FolderDataset
from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.demos.orientations import check_orientations
from geomotion.demos.readers import read
from geomotion.errors import DatasetError

TIME_S = np.linspace(0, 1, 20)
ORDER = {"orientation_wxyz": [0, 1, 2, 3], "orientation_xyzw": [1, 2, 3, 0]}


def turning(offset: float) -> np.ndarray:
    """About an axis near x, around a quarter of a turn."""
    half = np.pi / 4 + 0.2 * TIME_S + offset
    return np.stack([np.cos(half), np.sin(half), 0 * half, 0 * half], axis=1)


def demonstrations(*orientations: np.ndarray) -> Demonstrations:
    position = np.stack([TIME_S, TIME_S, TIME_S], axis=1)
    made = (Trajectory(TIME_S, {"position_m": position, "orientation_wxyz": one}) for one in orientations)
    return Demonstrations("toy", tuple(made), "R3xS3")


def test_one_motion_in_one_order_passes_whatever_the_signs():
    check_orientations(demonstrations(turning(0.0), -turning(0.1), turning(0.05)))
    check_orientations(demonstrations(turning(0.0)))


def test_the_one_demonstration_with_the_scalar_last_is_named():
    wrong = turning(0.0)[:, ORDER["orientation_xyzw"]]
    with pytest.raises(DatasetError, match=r"demonstration 2: .*x, y, z, w.*orientation_xyzw"):
        check_orientations(demonstrations(turning(0.0), turning(0.1), wrong, turning(0.05)))


def test_what_jumps_is_no_motion():
    jumps = turning(0.0)
    jumps[7] = [0, 0, 1, 0]
    with pytest.raises(DatasetError, match="row 7: the orientation turns 180 degrees in one sample"):
        check_orientations(demonstrations(jumps))


@pytest.mark.parametrize("name", list(ORDER))
def test_arrays_say_in_their_name_where_the_scalar_part_stands(tmp_path, name):
    values = turning(0.0)[:, ORDER[name]]
    np.savez(tmp_path / "0.npz", time_s=TIME_S, position_m=np.ones((20, 3)), **{name: values})
    found = read(FolderDataset(name="folder", root=str(tmp_path)))
    np.testing.assert_allclose(found[0].channels["orientation_wxyz"], turning(0.0))
