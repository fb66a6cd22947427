import numpy as np
import pytest

from geomotion.figures.latent import LatentMaps
from geomotion.figures.methods import STYLES, MethodCurve, figure_methods, save_methods_figure

AXES = np.linspace(-1, 1, 20), np.linspace(-1, 1, 20)


@pytest.fixture
def maps() -> LatentMaps:
    distance = np.hypot(*np.meshgrid(*AXES, indexing="ij"))
    codes = [np.linspace([-0.5, 0], [0.5, 0], 30)]
    return LatentMaps(AXES, distance, distance, distance < 0.8, codes, np.empty((0, 2)), [0])


@pytest.fixture
def curves() -> list[MethodCurve]:
    line = np.linspace([-0.5, 0], [0.5, 0], 30)
    return [
        MethodCurve(name, line + np.array([0, 0.1 * number]), 1.5 + number, 0.25) for number, name in enumerate(STYLES)
    ]


def test_every_method_has_a_look_of_its_own_and_stands_in_the_legend_with_length_and_time(maps, curves):
    figure = figure_methods(curves, maps)
    ax = figure.axes[0]
    drawn = ax.get_lines()[-len(curves) :]
    for line, curve in zip(drawn, curves, strict=True):
        np.testing.assert_array_equal(line.get_xydata(), curve.codes)
    assert len({line.get_color() for line in drawn}) == len(curves)
    labels = [text.get_text() for text in figure.legends[0].texts]
    assert labels[:2] == ["straight line: length 1.50, 0.25 s", "graph 50: length 2.50, 0.25 s"]
    assert {"encoded demonstrations", "support cap"} <= set(labels)


def test_curves_lie_over_the_magnification_factor_with_equal_scales(maps, curves):
    ax = figure_methods(curves, maps).axes[0]
    assert ax.get_title() == "magnification factor" and ax.get_aspect() == 1
    assert ax.get_xlabel().endswith("[1]") and ax.get_ylabel().endswith("[1]")


def test_picture_is_saved_with_its_curves(maps, curves, tmp_path):
    assert save_methods_figure(curves, maps, tmp_path) == ["methods.png", "methods.pdf", "methods.npz"]
    with np.load(tmp_path / "methods.npz") as behind:
        for curve in curves:
            np.testing.assert_array_equal(behind[curve.name], curve.codes)
