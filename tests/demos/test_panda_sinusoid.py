import numpy as np
import pytest

from geomotion.config import PandaSinusoidDataset
from geomotion.demos.generators.panda_sinusoid import AMPLITUDE_M, DOWN_WXYZ, END_M, START_M
from geomotion.demos.readers import read


@pytest.fixture(scope="module")
def waves():
    return read(PandaSinusoidDataset(name="panda/sinusoid", demos=3, points=120)).trajectories


def test_the_hand_goes_from_end_to_end_and_swings_three_times(waves):
    for one in waves:
        position = one.channels["position_m"]
        np.testing.assert_allclose(position[0], START_M, atol=0.05)
        np.testing.assert_allclose(position[-1], END_M, atol=0.05)
        across = position[:, 0] - START_M[0]
        assert np.ptp(across) == pytest.approx(2 * AMPLITUDE_M, abs=0.05)
        turns = np.diff(np.sign(np.diff(across[5:-5])))
        assert np.count_nonzero(turns) == 3


def test_the_hand_points_down_throughout(waves):
    for one in waves:
        towards = np.abs(one.channels["orientation_wxyz"] @ np.array(DOWN_WXYZ))
        np.testing.assert_allclose(towards, 1, atol=1e-5)
