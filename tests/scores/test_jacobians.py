"""True Jacobians against closed forms; contraction in a chart's metric computed in two independent ways."""

import pytest
import torch

from geomotion.dynamics.charts import ComposedChart, IdentityChart, ScalingChart
from geomotion.dynamics.fields import ChartedField
from geomotion.scores.jacobians import eigenvalues_in_metric, field_jacobian, symmetric_eigenvalues

torch.manual_seed(0)
POINTS = torch.randn(7, 2, dtype=torch.float64)


def test_the_jacobian_of_a_linear_map_is_its_matrix():
    matrix = torch.randn(3, 3, dtype=torch.float64)
    found = field_jacobian(lambda x: x @ matrix.T, torch.randn(5, 3, dtype=torch.float64))
    torch.testing.assert_close(found, matrix.expand(5, 3, 3))


def test_the_jacobian_of_a_quadratic_map_follows_its_point():
    found = field_jacobian(lambda x: torch.stack([x[:, 0] * x[:, 1], x[:, 1] ** 2], dim=1), POINTS)
    x, y = POINTS.T
    expected = torch.stack([torch.stack([y, x], -1), torch.stack([0 * y, 2 * y], -1)], dim=1)
    torch.testing.assert_close(found, expected)


def test_jacobians_pass_through_the_closure_of_a_chart(spiral):
    field = spiral()
    matrix = field.field.matrix.detach() / field.time_unit_s
    found = field_jacobian(field, POINTS)
    # ẋ = Dψ⁻¹ A ψ(x), differentiated by hand for ψ = (x, y + x²)
    x, y = POINTS.T
    (a, b), (c, d) = matrix.tolist()
    z = y + x**2
    first = torch.stack([a + 2 * b * x, b + 0 * x], -1)
    second = torch.stack([c + 2 * d * x - 2 * (a * x + b * z) - 2 * x * (a + 2 * b * x), d - 2 * x * b], -1)
    torch.testing.assert_close(found, torch.stack([first, second], dim=1))


def test_jacobians_are_found_where_gradients_are_switched_off(spiral):
    field = spiral()
    with torch.no_grad():
        found = field_jacobian(field, POINTS)
    torch.testing.assert_close(found, field_jacobian(field, POINTS))
    assert not found.requires_grad
    assert not POINTS.requires_grad


def test_outputs_that_do_not_depend_on_the_state_have_zero_rows():
    found = field_jacobian(lambda x: torch.stack([x[:, 0], torch.ones_like(x[:, 1])], dim=1), POINTS)
    torch.testing.assert_close(found, torch.tensor([[1.0, 0.0], [0.0, 0.0]], dtype=torch.float64).expand(7, 2, 2))


def test_eigenvalues_of_the_symmetric_part_ignore_rotation():
    rotating = torch.tensor([[[-1.0, 5.0], [-5.0, -2.0]]], dtype=torch.float64)
    torch.testing.assert_close(symmetric_eigenvalues(rotating), torch.tensor([[-2.0, -1.0]], dtype=torch.float64))


@pytest.mark.parametrize("scale", [1.0, 0.05])
def test_contraction_in_the_charts_metric_is_that_of_the_latent_field(spiral, scale):
    inner = spiral(rate=1.3, spin=2.0, time_unit_s=3.0)
    centre = torch.tensor([0.3, -0.1], dtype=torch.float64)
    field = ChartedField(ComposedChart(ScalingChart(centre, scale), inner.chart), inner.field, inner.time_unit_s)
    in_robot_coordinates = eigenvalues_in_metric(field, field.chart, centre + scale * POINTS)
    latent = field_jacobian(field.field, field.chart.to_latent(centre + scale * POINTS)) / field.time_unit_s
    torch.testing.assert_close(in_robot_coordinates, symmetric_eigenvalues(latent))


def test_the_metric_of_the_identity_chart_is_euclidean(spiral):
    field = spiral()
    found = eigenvalues_in_metric(field, IdentityChart(2), POINTS)
    torch.testing.assert_close(found, symmetric_eigenvalues(field_jacobian(field, POINTS)))


def test_a_field_that_was_changed_in_robot_coordinates_is_judged_as_changed(spiral):
    field = spiral()
    doubled = eigenvalues_in_metric(lambda x: 2 * field(x), field.chart, POINTS)
    torch.testing.assert_close(doubled, 2 * eigenvalues_in_metric(field, field.chart, POINTS))
