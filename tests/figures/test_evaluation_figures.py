import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import CenteredNorm
from matplotlib.figure import Figure

from geomotion.errors import CorruptArtefact, MissingData
from geomotion.figures.arrays import from_arrays, read_evaluation
from geomotion.figures.eigenvalues import draw_eigenvalue_map, figure_eigenvalues, panels, robust_norm
from geomotion.figures.evaluation import figures, save_all
from geomotion.figures.goals import figure_goal_starts
from geomotion.figures.motion import draw_rollouts, figure_motion, widely_spread
from geomotion.figures.nearby import draw_nearby, relative
from geomotion.figures.region import draw_region, draw_steps_inside, figure_region
from geomotion.figures.style import COLOUR, percent
from geomotion.figures.training import draw_losses, figure_training, save_training_figure


def axes_of(figure):
    """Axes that are on, after everything has been laid out and drawn once."""
    FigureCanvasAgg(figure).draw()
    return [ax for ax in figure.axes if ax.axison]


def lines_of(ax, colour):
    return [line for line in ax.get_lines() if line.get_color() == COLOUR[colour] and len(line.get_xdata()) > 2]


@pytest.mark.parametrize("arrays", ["planar_arrays", "spatial_arrays"])
def test_every_axis_is_labelled_with_a_unit_and_every_curve_is_finite_somewhere(arrays, request):
    data = from_arrays(request.getfixturevalue(arrays))
    for draw in figures(data, rate_per_s=0.8).values():
        for ax in axes_of(draw(data)):
            shown = [label for label in (ax.get_xlabel(), ax.get_ylabel()) if label]
            assert all(label.endswith("]") and "[" in label for label in shown)
            assert all(np.isfinite(np.asarray(line.get_xydata(), dtype=float)).any() for line in ax.get_lines())
            assert np.isfinite([*ax.get_xlim(), *ax.get_ylim()]).all()


def test_motion_draws_each_demonstration_and_rollout_in_its_colour_and_held_out_ones_in_another_style(planar_arrays):
    (ax,) = axes_of(figure_motion(from_arrays(planar_arrays)))
    assert ax.get_aspect() == 1.0
    demonstrations, rollouts = lines_of(ax, "demonstration"), lines_of(ax, "rollout")
    paths = [line for line in rollouts if line.get_linestyle() != "None"]
    assert len(demonstrations) == len(paths) == 7
    assert [line.get_linestyle() for line in demonstrations] == ["-"] * 5 + [":"] * 2
    assert [line.get_linestyle() for line in paths] == ["-"] * 5 + ["--"] * 2
    np.testing.assert_array_equal(paths[3].get_xydata(), planar_arrays["rollout_3"])


def test_rollout_markers_sit_at_the_starts(planar_arrays):
    judged = from_arrays(planar_arrays).judged
    markers = draw_rollouts(Figure().add_subplot(), judged).get_lines()[-1]
    np.testing.assert_array_equal(markers.get_xydata(), [item.rollout[0] for item in judged])


def test_state_of_four_dimensions_is_drawn_coordinate_by_coordinate_over_time(spatial_arrays):
    axes = axes_of(figure_motion(from_arrays(spatial_arrays)))
    assert [ax.get_ylabel() for ax in axes] == [rf"$x_{{{axis}}}$ [m]" for axis in (1, 2, 3, 4)]
    assert [ax.get_xlabel() for ax in axes[-2:]] == ["time [s]"] * 2
    assert all(len(ax.get_lines()) == 6 for ax in axes)


def test_a_diverging_rollout_does_not_shrink_the_others(planar_arrays, spatial_arrays):
    rollouts = planar_arrays["region_rollouts"].copy()
    rollouts[0, 10:] = 1e6
    diverged = {
        "region_rollouts": rollouts,
        "rollout_0": np.where(np.arange(200)[:, None] > 99, 1e6, 0.01 * np.ones((1, 2))),
    }
    data = from_arrays(planar_arrays | diverged)
    for ax in [*axes_of(figure_motion(data)), axes_of(figure_region(data))[0]]:
        assert max(ax.get_xlim()) < 0.2
    spatial = from_arrays(spatial_arrays | {"rollout_0": np.full((200, 4), 1e6)})
    assert all(max(ax.get_ylim()) < 0.2 for ax in axes_of(figure_motion(spatial)))


def test_widely_spread_picks_the_corners_of_a_square_first():
    side = np.linspace(0.0, 1.0, 5)
    points = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    corners = {tuple(points[number]) for number in widely_spread(points, 4)}
    assert corners == {(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)}


def test_eigenvalue_titles_state_the_share_that_does_not_contract(planar_arrays):
    shown = panels(from_arrays(planar_arrays).eigenvalues)
    share = np.mean(planar_arrays["true_eigenvalue"] >= 0)
    assert f"\n{100 * share:.1f}% not contracting (n = 400)" in shown[0].title
    assert "\n0% not contracting (n = 400)" in shown[1].title


def test_claimed_metric_is_not_repeated_where_it_is_the_euclidean_one_and_jhat_stands_beside(planar_arrays):
    rounded = planar_arrays["true_eigenvalue"].astype(np.float32).astype(float)
    same = {"claimed_eigenvalue": rounded, "jhat_eigenvalue": np.full(400, -0.01)}
    names = [panel.name for panel in panels(from_arrays(planar_arrays | same).eigenvalues)]
    assert len(names) == 2
    assert "true Jacobian" in names[0] and "hat{J}" in names[1]


def test_eigenvalue_maps_share_a_colour_scale_around_zero_that_ignores_outliers(planar_arrays):
    wild = planar_arrays["true_eigenvalue"].copy()
    wild[7], wild[8] = 1e4, np.nan
    figure = figure_eigenvalues(from_arrays(planar_arrays | {"true_eigenvalue": wild}))
    norms = [ax.collections[0].norm for ax in axes_of(figure)[:2]]
    assert norms[0] is norms[1]
    assert isinstance(norms[0], CenteredNorm) and norms[0].vcenter == 0
    assert 0 < norms[0].halfrange < 10


def test_an_eigenvalue_that_is_not_a_number_counts_as_not_contracting(planar_arrays):
    eigenvalues = np.full(400, -1.0)
    eigenvalues[0] = np.nan
    panel = panels(from_arrays(planar_arrays | {"true_eigenvalue": eigenvalues}).eigenvalues)[0]
    assert panel.share_not_contracting == 1 / 400


def test_area_that_does_not_contract_is_outlined_at_eigenvalue_zero(planar_arrays):
    """With eigenvalue x - x0 the outline is the vertical line x = x0."""
    points, shape = planar_arrays["grid_points"], (20, 20)
    x0 = 0.02
    grid = from_arrays(planar_arrays | {"true_eigenvalue": points[:, 0] - x0}).eigenvalues
    panel = panels(grid)[0]
    ax = draw_eigenvalue_map(Figure().add_subplot(), points, shape, panel, robust_norm([panel.eigenvalues]))
    outline = np.concatenate([path.vertices for path in ax.collections[-1].get_paths()])
    np.testing.assert_allclose(outline[:, 0], x0, atol=1e-12)
    np.testing.assert_allclose(np.ptp(outline[:, 1]), np.ptp(points[:, 1]))


def test_map_does_not_depend_on_the_order_of_the_grid(planar_arrays):
    data = from_arrays(planar_arrays)
    shuffled = np.random.default_rng(0).permutation(400)
    names = ("grid_points", "true_eigenvalue", "claimed_eigenvalue", "field_points", "field_velocity")
    other = from_arrays(planar_arrays | {name: planar_arrays[name][shuffled] for name in names})
    colours = [axes_of(figure_eigenvalues(one))[0].collections[0].get_array() for one in (data, other)]
    np.testing.assert_array_equal(*colours)
    arrows = [axes_of(figure_motion(one))[0].collections[0].get_segments() for one in (data, other)]
    np.testing.assert_array_equal(np.concatenate(arrows[0]), np.concatenate(arrows[1]))


def test_nearby_curves_are_relative_on_a_log_axis_with_the_bound_dashed(planar_arrays):
    nearby = from_arrays(planar_arrays).nearby
    ax = draw_nearby(Figure().add_subplot(), nearby, rate_per_s=0.8)
    assert ax.get_yscale() == "log"
    euclidean, claimed, bound = ax.get_lines()[:3]
    assert bound.get_linestyle() == "--" and "0.8 1/s" in bound.get_label()
    np.testing.assert_allclose(bound.get_ydata(), np.exp(-0.8 * nearby.time_s))
    assert (claimed.get_ydata() <= bound.get_ydata() * (1 + 1e-12)).all()
    assert euclidean.get_ydata()[0] == claimed.get_ydata()[0] == 1.0


def test_nearby_curves_without_proven_rate_show_no_bound_and_no_second_metric_that_is_the_first(spatial_arrays):
    ax = draw_nearby(Figure().add_subplot(), from_arrays(spatial_arrays).nearby)
    assert len(ax.get_legend().get_texts()) == 1


def test_relative_distance_has_gaps_where_a_logarithm_has_nothing_to_show():
    np.testing.assert_array_equal(relative(np.array([2.0, 1.0, 0.0, np.inf])), [1.0, 0.5, np.nan, np.nan])


def test_region_draws_every_inside_state_strong_and_every_outside_state_pale(planar_arrays):
    region = from_arrays(planar_arrays).region
    ax = draw_region(Figure().add_subplot(), region)
    strong = ax.get_lines()[1].get_xydata()
    stride = region.rollouts.shape[1] // 250
    inside = region.inside[:, ::stride]
    assert np.isfinite(strong).all(axis=1).sum() == inside.sum()
    np.testing.assert_array_equal(strong[np.isfinite(strong).all(axis=1)], region.rollouts[:, ::stride][inside])


def test_histogram_counts_every_rollout_once_and_states_the_mean(planar_arrays):
    region = from_arrays(planar_arrays).region
    ax = draw_steps_inside(Figure().add_subplot(), region)
    assert sum(bar.get_height() for bar in ax.patches) == len(region.rollouts)
    assert f"mean {planar_arrays['region_inside'].sum(axis=1).mean():.0f}" in ax.get_legend().get_texts()[0].get_text()


def test_starts_that_fail_are_marked_and_counted(planar_arrays):
    reached = np.arange(100) % 10 != 0
    data = from_arrays(planar_arrays | {"goal_reached": reached})
    (ax,) = axes_of(figure_goal_starts(data))
    assert ax.get_title() == "10 of 100 starts never reach the goal"
    (crosses,) = [line for line in ax.get_lines() if line.get_marker() == "x"]
    np.testing.assert_array_equal(crosses.get_xydata(), planar_arrays["goal_starts"][~reached])


def test_save_all_writes_picture_print_and_numbers_and_leaves_out_what_does_not_apply(planar_arrays, tmp_path):
    names = save_all(planar_arrays, {"rate_per_s": 0.8}, tmp_path)
    assert sorted(names) == sorted(path.name for path in tmp_path.iterdir())
    stems = {name.partition(".")[0] for name in names}
    assert stems == {"motion", "eigenvalues", "nearby", "region"}  # every start reaches the goal
    with np.load(tmp_path / "nearby.npz") as behind:
        np.testing.assert_array_equal(behind["nearby_bound"], planar_arrays["nearby_bound"])
    inlined = sum(path.stat().st_size for path in tmp_path.glob("*.png")) * 4 / 3
    assert inlined < 2.5e6  # a report carries them in itself


def test_save_all_in_four_dimensions_needs_no_plane(spatial_arrays, tmp_path):
    names = save_all(spatial_arrays, {}, tmp_path)
    assert {name.partition(".")[0] for name in names} == {"motion", "eigenvalues", "nearby"}


def test_evaluation_without_demonstrations_or_with_a_damaged_file_is_named(planar_arrays, tmp_path):
    with pytest.raises(MissingData, match="demonstration"):
        from_arrays({"goal": np.zeros(2)})
    path = tmp_path / "evaluation.npz"
    with pytest.raises(MissingData, match=r"evaluation\.npz"):
        read_evaluation(path)
    np.savez(path, **planar_arrays)
    assert read_evaluation(path).dim == 2
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(CorruptArtefact, match=r"evaluation\.npz"):
        read_evaluation(path)


@pytest.mark.parametrize(
    ("share", "text"), [(0.0, "0%"), (1.0, "100%"), (1e-5, "0.1%"), (0.99999, "99.9%"), (0.25, "25.0%")]
)
def test_percentages_say_none_and_all_only_for_none_and_all(share, text):
    assert percent(share) == text


def curves(**terms):
    steps = np.arange(0, 100, 20.0)
    return pd.DataFrame(
        {"step": steps, "total": np.exp(-steps / 50), **terms, "learning_rate": np.linspace(1e-3, 0, 5)}
    )


def test_training_shows_total_and_terms_on_a_log_axis_and_the_learning_rate_below():
    losses, rate = axes_of(figure_training(curves(velocity=np.exp(-np.arange(5.0)))))
    assert losses.get_yscale() == "log"
    assert [text.get_text() for text in losses.get_legend().get_texts()] == ["velocity", "total"]
    assert rate.get_xlabel() == "optimiser step [1]" and rate.get_ylabel() == "learning rate [1]"


def test_a_loss_term_below_zero_stays_visible():
    ax = draw_losses(Figure().add_subplot(), curves(spread=-np.arange(1.0, 6.0)))
    assert ax.get_yscale() == "symlog"
    assert ax.get_ylim()[0] <= -5


def test_training_figure_is_saved_with_its_numbers(tmp_path):
    assert save_training_figure(curves(), tmp_path) == ["training.png", "training.pdf", "training.npz"]
    with np.load(tmp_path / "training.npz") as behind:
        np.testing.assert_array_equal(behind["total"], curves()["total"])
