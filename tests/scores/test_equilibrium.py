"""Equilibria of fields that are known."""

import numpy as np
import pytest
import torch
from torch import nn

from geomotion.dynamics.charts import ScalingChart
from geomotion.dynamics.fields import ChartedField
from geomotion.scores.equilibrium import find_equilibrium, judge_equilibrium
from geomotion.scores.evaluation import Unit

MILLIMETRES = Unit("mm", 1000.0)
CENTRE, SCALE_M, TIME_UNIT_S = (0.2, -0.1), 0.1, 2.0


class Latent(nn.Module):
    """A planar latent field by its formula; its parameter says in which precision."""

    dim = 2

    def __init__(self, formula):
        super().__init__()
        self.formula = formula
        self.one = nn.Parameter(torch.ones(()))

    def forward(self, z):
        return self.one * self.formula(z)


def charted(formula) -> ChartedField:
    return ChartedField(ScalingChart(torch.tensor(CENTRE), SCALE_M), Latent(formula), TIME_UNIT_S).double()


def ambient(*z: float) -> np.ndarray:
    return np.float32(CENTRE) + np.float32(SCALE_M) * np.array(z)


def cubic(z):
    """-(z - c) - (z - c)³ with the equilibrium c = (0.3, 0.4)."""
    away = z - torch.tensor([0.3, 0.4], dtype=z.dtype)
    return -away - away**3


def test_the_equilibrium_of_a_nonlinear_field_is_found():
    found = find_equilibrium(charted(cubic), ambient(-1.0, 2.0), SCALE_M)
    np.testing.assert_allclose(found, ambient(0.3, 0.4), atol=1e-10)


def test_distances_and_speed_are_those_of_the_formula():
    scores = judge_equilibrium(charted(cubic), ambient(0.0, 0.0), ambient(0.3, 0.5), SCALE_M, MILLIMETRES).scores
    assert {name: score.unit for name, score in scores.items()} == {
        "equilibrium.speed_at_goal": "mm/s",
        "equilibrium.goal_distance": "mm",
        "equilibrium.end_distance": "mm",
    }
    speed = np.hypot(0.3 + 0.3**3, 0.4 + 0.4**3) * 1000 * SCALE_M / TIME_UNIT_S
    assert scores["equilibrium.speed_at_goal"].value == pytest.approx(speed, rel=1e-6)
    assert scores["equilibrium.goal_distance"].value == pytest.approx(50.0, rel=1e-6)
    assert scores["equilibrium.end_distance"].value == pytest.approx(10.0, rel=1e-6)


def test_a_field_that_is_at_rest_at_its_goal_has_no_distance_to_it(spiral):
    scores = judge_equilibrium(spiral(), np.zeros(2), np.array([0.0, 0.004]), 0.1, MILLIMETRES).scores
    assert scores["equilibrium.speed_at_goal"].value == 0
    assert scores["equilibrium.goal_distance"].value == pytest.approx(0, abs=1e-9)
    assert scores["equilibrium.end_distance"].value == pytest.approx(4.0)


def test_a_field_that_rests_nowhere_says_so():
    evaluation = judge_equilibrium(charted(lambda z: 1 + z**2), ambient(0, 0), ambient(0, 0), SCALE_M, MILLIMETRES)
    assert set(evaluation.scores) == {"equilibrium.speed_at_goal"}
    assert "no state at rest" in evaluation.omitted["equilibrium"]
