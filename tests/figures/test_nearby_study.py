"""Fig. 6.6: one curve for each method, in both metrics."""

import numpy as np

from geomotion.figures.studies.nearby import nearby
from geomotion.figures.studies.panels import JudgedCell


def test_every_variant_has_a_curve_that_begins_at_one(planar_arrays, tmp_path):
    cells = []
    for dataset in ("a", "b"):
        for variant in ("ours", "theirs"):
            folder = tmp_path / f"{dataset} {variant}"
            folder.mkdir()
            np.savez(folder / "evaluation.npz", **planar_arrays)
            cells += [JudgedCell(dataset, variant, seed, folder) for seed in (0, 1)]
    drawn = nearby(cells)
    assert [ax.get_title().split("\n")[0] for ax in drawn.figure.axes] == ["a", "a", "b", "b"]
    for ax in drawn.figure.axes:
        curves = [line for line in ax.get_lines() if len(line.get_xdata()) > 2]
        assert [line.get_label() for line in curves] == ["ours", "theirs"]
        assert all(line.get_ydata()[0] == 1 and line.get_xdata()[-1] == 1 for line in curves)
    np.testing.assert_array_equal(drawn.data["euclidean_3"], planar_arrays["nearby_euclidean"])


def test_nothing_is_drawn_without_distances(planar_arrays, tmp_path):
    kept = {name: value for name, value in planar_arrays.items() if not name.startswith("nearby")}
    np.savez(tmp_path / "evaluation.npz", **kept)
    assert nearby([JudgedCell("a", "ours", 0, tmp_path)]) is None
