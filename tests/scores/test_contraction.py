"""Contraction scores of fields whose eigenvalues are known."""

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from geomotion.dynamics.charts import IdentityChart
from geomotion.dynamics.fields import ChartedField
from geomotion.scores.contraction import contraction_scores, judge_contraction

POINTS = torch.rand(50, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(0)) - 0.5


def test_the_rate_of_a_linear_field_is_the_largest_eigenvalue_of_its_symmetric_part(plain_linear):
    field = plain_linear(spin=3.0, time_unit_s=2.0)
    with torch.no_grad():
        field.field.symmetric_root.copy_(torch.diag(torch.tensor([1.0, 2.0])))
    scores = judge_contraction(field, POINTS, "").scores
    matrix = field.field.matrix.detach()
    smallest, largest = torch.linalg.eigvalsh((matrix + matrix.T) / 2).tolist()
    for coordinates in ("true", "claimed"):
        assert scores[f"contraction.{coordinates}.rate"].value == pytest.approx(largest / 2)
        assert scores[f"contraction.{coordinates}.mean_rate"].value == pytest.approx(largest / 2)
        assert scores[f"contraction.{coordinates}.ratio"].value == pytest.approx((largest - smallest) / 2)
        assert scores[f"contraction.{coordinates}.non_contracting_fraction"].value == 0
    assert scores["contraction.true.rate"].unit == "1/s"


def test_a_field_can_contract_in_its_chart_and_not_in_the_robots_coordinates(spiral):
    field = spiral(rate=1.0, spin=2.0, time_unit_s=2.0)
    evaluation = judge_contraction(field, 3 * POINTS, "")
    assert evaluation.scores["contraction.claimed.rate"].value == pytest.approx(-0.5)
    assert evaluation.scores["contraction.true.rate"].value > 0
    np.testing.assert_allclose(evaluation.arrays["claimed_eigenvalue"], -0.5)
    assert evaluation.arrays["jhat_eigenvalue"].size == 0
    assert "contraction.jhat" in evaluation.omitted


class ClaimingField(nn.Module):
    """f(x) = x, which expands, with a matrix that claims the contrary."""

    dim = 2

    def forward(self, x: Tensor) -> Tensor:
        return x

    def contraction_jacobian(self, x: Tensor) -> Tensor:
        return -3 * torch.eye(2, dtype=x.dtype).expand(*x.shape, 2)


def test_the_networks_matrix_is_shown_beside_the_true_jacobian_and_never_for_it():
    scores = judge_contraction(ChartedField(IdentityChart(2), ClaimingField(), 1.5), POINTS, "").scores
    assert scores["contraction.jhat.rate"].value == pytest.approx(-2)
    assert scores["contraction.true.rate"].value == pytest.approx(1 / 1.5)
    assert scores["contraction.true.non_contracting_fraction"].value == 1
    assert "not the Jacobian" in scores["contraction.jhat.rate"].note


def test_summaries_over_points_by_hand():
    eigenvalues = np.array([[-4.0, -1.0], [-2.0, 0.0], [-3.0, 1.0], [-1.0, -0.5]])
    scores = contraction_scores(eigenvalues, "")
    assert scores["rate"].value == 1.0
    assert scores["mean_rate"].value == pytest.approx(-0.125)
    assert scores["ratio"].value == 4.0
    assert scores["non_contracting_fraction"].value == 0.5  # zero does not contract
    assert scores["non_contracting_fraction"].count == 4
