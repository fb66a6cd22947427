import numpy as np
import pytest
from matplotlib.figure import Figure

from geomotion.figures.arm_failures import FailureMap, draw_failures, save_failures_figure
from geomotion.figures.latent import LatentMaps

AXES = np.linspace(-1, 1, 20), np.linspace(-1, 1, 20)
COARSE = np.linspace(-1, 1, 5), np.linspace(-1, 1, 5)


@pytest.fixture
def maps() -> LatentMaps:
    distance = np.hypot(*np.meshgrid(*AXES, indexing="ij"))
    return LatentMaps(AXES, distance, distance, distance < 0.8, [np.zeros((3, 2))], np.empty((0, 2)), [0])


@pytest.fixture
def failures() -> FailureMap:
    share = np.arange(25).reshape(5, 5) / 24
    share[0, 0] = np.nan
    return FailureMap(COARSE, share, 20)


def test_shares_are_drawn_on_one_scale_from_none_to_all_and_nothing_where_none_was_judged(failures, maps):
    ax = draw_failures(Figure().add_subplot(), failures, maps)
    image = ax.collections[0]
    assert image.get_clim() == (0, 1)
    np.testing.assert_array_equal(image.get_array().filled(np.nan).ravel(), failures.share.T.ravel())
    assert image.get_array().mask.sum() == 1


def test_the_numbers_are_saved_beside_the_picture(failures, maps, tmp_path):
    assert save_failures_figure(failures, maps, tmp_path) == [f"arm_failures{end}" for end in (".png", ".pdf", ".npz")]
    with np.load(tmp_path / "arm_failures.npz") as stored:
        np.testing.assert_array_equal(stored["share"], failures.share)
