"""Offsets and ways to the manifold, of skills with fewer coordinates than their states."""

import numpy as np
import pytest
import torch

from geomotion.dynamics.charts import AnchoredChart, IdentityChart, ScalingChart
from geomotion.dynamics.embedded import EmbeddedField
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.injective import DecoderChart, decoded
from geomotion.dynamics.linear import LinearField
from geomotion.networks.spline_flow import SplineFlow
from geomotion.scores.off_manifold import judge_off_manifold
from geomotion.scores.reproduction import Judged

SCALE_M = 0.1


def in_millimetres(states, others):
    return {"distance": ("mm", 1000 * np.linalg.norm(states - others, axis=1))}


def embedded() -> ChartedField:
    chart = AnchoredChart(ScalingChart(torch.zeros(3), SCALE_M), torch.zeros(3))
    return ChartedField(chart, EmbeddedField(LinearField(2, 1.0, 2.0), 3, 5.0), 1.0)


def with_decoder() -> ChartedField:
    decoder = DecoderChart(ScalingChart(torch.zeros(3), SCALE_M), SplineFlow(3, 3, 10, 10.0, 1, 4), 2)
    return decoded(decoder, ChartedField(IdentityChart(2), LinearField(2, 1.0, 2.0), 1.0))


def demonstration(height_m: float, is_trained: bool) -> Judged:
    """Of the plane that both skills move in, at a height that falls to a fourth."""
    time_s = np.linspace(0, 1, 4)
    states = np.outer(1 - time_s, [0.1, 0.05, 0.0])
    states[:, 2] = height_m * np.array([1.0, 0.25, 0.25, 0.25])
    return Judged(time_s, states, states, states, states, is_trained)


@pytest.mark.parametrize("make", [embedded, with_decoder])
def test_heights_above_the_plane_are_offsets_and_distances(make):
    judged = [demonstration(0.01, True), demonstration(-0.03, False)]
    scores = judge_off_manifold(make(), judged, in_millimetres).scores
    for subset, height_m in (("train", 0.01), ("heldout", 0.03)):
        for where, share in (("starts", 1.0), ("states", 1.75 / 4)):
            name = f"{subset}.manifold.{where}"
            assert scores[f"{name}_offset"].value == pytest.approx(share * height_m / SCALE_M, rel=1e-4)
            assert scores[f"{name}_distance"].value == pytest.approx(1000 * share * height_m, rel=1e-4)


def test_a_skill_of_all_coordinates_has_nothing_beside_it():
    field = ChartedField(IdentityChart(3), LinearField(3, 1.0, 2.0), 1.0)
    assert not judge_off_manifold(field, [demonstration(0.01, True)], in_millimetres).scores
