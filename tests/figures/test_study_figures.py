"""Pictures of a study: a panel for each variant on each dataset, and the numbers behind them."""

from pathlib import Path

import numpy as np
import pytest

from geomotion.figures.studies import fields
from geomotion.figures.studies.panels import JudgedCell


@pytest.fixture
def cells(planar_arrays, tmp_path) -> list[JudgedCell]:
    """Two datasets, two variants, two seeds; only one variant has Ĵ."""
    found = []
    for number, (dataset, variant, seed) in enumerate(
        (dataset, variant, seed) for dataset in ("a", "b") for variant in ("plain", "thesis") for seed in (0, 1)
    ):
        spectrum = planar_arrays["true_eigenvalue"]
        arrays = planar_arrays | {"true_smallest_eigenvalue": spectrum - 1.5}
        if variant == "thesis":
            arrays |= {"jhat_eigenvalue": spectrum - 9.0, "jhat_smallest_eigenvalue": spectrum - 10.0}
        folder = tmp_path / str(number)
        folder.mkdir()
        np.savez(folder / "evaluation.npz", **arrays)
        found.append(JudgedCell(dataset, variant, seed, folder))
    return found


def titles(figure) -> list[str]:
    return [ax.get_title() for ax in figure.axes if ax.get_title()]


@pytest.mark.parametrize("draw", [fields.motions, fields.regions])
def test_datasets_have_rows_and_variants_columns_with_the_first_seed_in_each(cells, draw):
    drawn = draw(cells)
    assert titles(drawn.figure) == ["a\nplain", "a\nthesis", "b\nplain", "b\nthesis"]
    assert drawn.data["cell_3"] == "b: thesis, seed 0"


def test_only_rollouts_from_the_corners_are_drawn_beside_those_of_demonstrations(cells):
    ax = fields.motions(cells).figure.axes[0]
    (corners,) = [line.get_xydata() for line in ax.get_lines() if line.get_marker() == "s"]
    assert {tuple(np.sign(corner - corners.mean(axis=0))) for corner in corners} == {(-1, -1), (-1, 1), (1, -1), (1, 1)}


def test_steps_inside_of_all_seeds_are_pooled(cells, planar_arrays):
    drawn = fields.steps_inside(cells)
    assert titles(drawn.figure) == ["a", "b"]
    points = [line for line in drawn.figure.axes[0].get_lines() if line.get_marker() == "."]
    steps = planar_arrays["region_inside"].sum(axis=1)
    for line in points:
        np.testing.assert_array_equal(np.sort(line.get_ydata()), np.sort(np.tile(steps, 2)))
    assert len(points) == 2


def test_maps_show_both_eigenvalues_and_their_difference(cells, planar_arrays):
    drawn = fields.eigenvalues_true(cells)
    maps = [ax.collections[0].get_array() for ax in drawn.figure.axes if ax.collections and ax.get_xlim()[1] < 1]
    assert len(maps) >= 12
    np.testing.assert_allclose(drawn.data["largest_0"] - drawn.data["smallest_0"], 1.5)


def test_variants_without_a_matrix_of_their_own_are_left_out(cells):
    drawn = fields.eigenvalues_jhat(cells)
    assert [str(drawn.data[f"cell_{number}"]) for number in range(2)] == ["a: thesis, seed 0", "b: thesis, seed 0"]
    assert "cell_2" not in drawn.data
    assert fields.eigenvalues_jhat([cell for cell in cells if cell.variant == "plain"]) is None


def test_nothing_is_drawn_of_fields_in_more_dimensions(spatial_arrays, tmp_path: Path):
    np.savez(tmp_path / "evaluation.npz", **spatial_arrays)
    cells = [JudgedCell("a", "plain", 0, tmp_path)]
    assert [draw(cells) for draw in fields.FIELD_STUDY_FIGURES.values()] == [None] * 5
