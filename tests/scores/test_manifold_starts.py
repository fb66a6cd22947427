"""Starts beside a manifold: decoded skills are led to it, and embedded ones come by themselves."""

import numpy as np
import pytest

from geomotion.dynamics.charts import IdentityChart
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.linear import LinearField
from geomotion.scores.array_field import ArrayField
from geomotion.scores.evaluation import Unit
from geomotion.scores.manifold_starts import BACK, TRANSITION, judge_manifold_starts

from .test_off_manifold import embedded, with_decoder

STARTS = np.array([[0.1, 0.05, 0.02], [0.1, 0.06, -0.04]])
TIMES_S = np.linspace(0, 1, 21)
MILLIMETRES = Unit("mm", 1000.0)


def judged(field: ChartedField):
    found = judge_manifold_starts(ArrayField(field.double(), method="rk4"), STARTS, TIMES_S, MILLIMETRES)
    return {name: score.value for name, score in found.scores.items()}, found.arrays


def test_an_embedded_skill_comes_back_at_its_transverse_rate():
    scores, arrays = judged(embedded())
    assert scores["off_manifold.jump"] == pytest.approx(30.0)
    assert scores["off_manifold.left"] == pytest.approx(30.0 * np.exp(-5), rel=1e-2)
    assert scores["off_manifold.left_uncorrected"] == scores["off_manifold.left"]
    assert scores["off_manifold.back_after"] == pytest.approx(np.log(10) / 5, abs=0.051)
    expected = np.abs(STARTS[:, 2:]) * np.exp(-5 * TIMES_S)
    np.testing.assert_allclose(arrays["off_manifold_away"], expected, rtol=1e-2)


def test_a_decoded_skill_is_led_to_its_manifold_and_keeps_its_offset_without_that():
    scores, arrays = judged(with_decoder())
    assert scores["off_manifold.jump"] == pytest.approx(30.0, rel=1e-4)
    assert scores["off_manifold.left"] < 1e-6
    assert scores["off_manifold.left_uncorrected"] > 20
    assert scores["off_manifold.back_after"] == pytest.approx((1 - BACK) * TRANSITION, abs=0.051)
    is_led = TIMES_S < TRANSITION
    shrinking = np.abs(STARTS[:, 2:]) * (1 - TIMES_S[is_led] / TRANSITION)
    np.testing.assert_allclose(arrays["off_manifold_away"][:, is_led], shrinking, atol=1e-9)
    assert arrays["off_manifold_states"].shape == (2, 21, 3)


def test_a_skill_of_all_coordinates_has_no_manifold_to_be_beside():
    field = ChartedField(IdentityChart(3), LinearField(3, 1.0, 2.0), 1.0)
    assert not judge_manifold_starts(ArrayField(field), STARTS, TIMES_S, MILLIMETRES).scores
