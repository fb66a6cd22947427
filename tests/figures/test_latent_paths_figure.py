import numpy as np

from geomotion.figures.arrays import from_arrays
from geomotion.figures.evaluation import figures
from geomotion.figures.latent_paths import figure_latent_paths

AXIS = np.linspace(-1, 1, 10)


def data(second_is_skill):
    points = np.stack([one.ravel() for one in np.meshgrid(AXIS, AXIS)], axis=1)
    path = np.exp(-np.linspace(0, 3, 40))[:, None] * np.array([1.0, 0.5])
    arrays = {
        "demo_0": np.zeros((40, 5)), "rollout_0": np.zeros((40, 5)), "time_0": np.arange(40.0),
        "set_0": np.array("train"),
        "latent_demonstrated": path * [1, 0], "latent_paths": np.stack([path * [1, 0], path]), "latent_points": points,
        "latent_velocity": -points, "latent_is_skill": np.array([True, second_is_skill]),
    }  # fmt: skip
    return from_arrays(arrays)


def test_the_second_axis_says_what_it_is():
    labels = [figure_latent_paths(data(is_skill)).axes[0].get_ylabel() for is_skill in (True, False)]
    assert labels == ["$z_2$", "beside the skill's manifold"]


def test_it_is_drawn_where_there_is_a_latent_plane():
    assert "latent_paths" in figures(data(False), None)
    without = from_arrays(
        {name: np.zeros((40, 5)) for name in ("demo_0", "rollout_0", "time_0")} | {"set_0": np.array("train")}
    )
    assert "latent_paths" not in figures(without, None)
