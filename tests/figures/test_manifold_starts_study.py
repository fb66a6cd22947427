"""Fig. 6.10: a column for each method, with the transition phase where there is one."""

import numpy as np

from geomotion.figures.studies.manifold_starts import LEADING, manifold_starts
from geomotion.figures.studies.panels import JudgedCell


def arrays(transition_s: float) -> dict[str, np.ndarray]:
    time_s = np.linspace(0, 1, 11)
    away = np.array([0.01, 0.02])[:, None] * np.exp(-5 * time_s)
    states = np.stack([np.stack([time_s, one, one], axis=1) for one in away])
    found = {"time_s": time_s, "states": states, "away": away, "uncorrected_away": away, "transition_s": transition_s}
    return {f"off_manifold_{name}": np.asarray(values) for name, values in found.items()}


def test_each_method_has_its_paths_and_distances(tmp_path):
    cells = []
    for variant, transition_s in (("thesis", 0.25), ("ours", 0.0)):
        (tmp_path / variant).mkdir()
        np.savez(tmp_path / variant / "evaluation.npz", **arrays(transition_s))
        cells.append(JudgedCell("a", variant, 0, tmp_path / variant))
    drawn = manifold_starts(cells)
    paths = drawn.figure.axes[:2]
    assert [ax.get_title() for ax in paths] == ["a\nthesis", "a\nours"]
    led = [[len(line.get_xdata()) for line in ax.get_lines() if line.get_color() == LEADING] for ax in paths]
    assert led == [[4, 4], [1, 1]]
    np.testing.assert_array_equal(drawn.data["away_0"], arrays(0.25)["off_manifold_away"])


def test_nothing_is_drawn_of_skills_of_all_coordinates(tmp_path):
    np.savez(tmp_path / "evaluation.npz", nearby_time_s=np.zeros(2))
    assert manifold_starts([JudgedCell("a", "ours", 0, tmp_path)]) is None
