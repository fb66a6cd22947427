"""The attempt at a proof on fields that contract, and on fields that do not."""

import numpy as np
import pytest
import torch

from geomotion import config as schema
from geomotion import models
from geomotion.config import EvaluationConfig
from geomotion.dynamics.certificate import certify
from geomotion.dynamics.fields import ChartedField
from geomotion.models import ModelConfig
from geomotion.scores.jacobians import field_jacobian, symmetric_eigenvalues
from geomotion.stages.verification import prove
from geomotion.training.data import Geometry

STATES = np.random.default_rng(0).uniform([-0.1, 0.0], [0.1, 0.3], (50, 2))
SETTINGS = EvaluationConfig(verify_cells=300, grid_margin=0.2)


def integral(weights: float, epsilon: float = 1.0, chart: schema.ChartConfig | None = None) -> ChartedField:
    """A field whose network's parameters are so many times larger than at the start of a training."""
    field = schema.LineIntegralField(hidden_units=[8])
    regulariser = schema.ConstantRegulariser(epsilon=epsilon)
    config = ModelConfig(chart or schema.IdentityChart(), field, regulariser, seed=0)
    model = models.build(config, Geometry((0.0, 0.15), 0.15, (0.0, 0.15), (0.0, 0.1), 2.0)).eval()
    with torch.no_grad():
        for parameter in model.field.jacobian_root.parameters():
            parameter.mul_(weights)
    return model


def attempt(model: ChartedField, settings: EvaluationConfig = SETTINGS):
    certificate = certify(model, torch.from_numpy(STATES).float()).as_dict()
    return prove(certificate, model, STATES, settings)


def largest_eigenvalues(model: ChartedField, points: np.ndarray) -> np.ndarray:
    return symmetric_eigenvalues(field_jacobian(model.double(), torch.from_numpy(points)))[:, -1].detach().numpy()


def test_a_field_that_contracts_is_verified_on_a_box_at_a_rate_that_it_keeps():
    model = integral(1.0)
    evaluation, certificate = attempt(model)
    assert certificate["claim"] == "verified_on_set"
    assert evaluation.scores["verification.contracting"].value == 1.0
    lower, upper = (np.array(certificate["verified_set"][name]) for name in ("lower_m", "upper_m"))
    margin = 0.2 * np.ptp(STATES, axis=0)
    np.testing.assert_allclose(lower, STATES.min(axis=0) - margin, atol=1e-6)
    np.testing.assert_allclose(upper, STATES.max(axis=0) + margin, atol=1e-6)
    found = largest_eigenvalues(model, np.random.default_rng(1).uniform(lower, upper, (500, 2)))
    assert found.max() <= -certificate["rate_per_s"]
    assert certificate["rate_per_s"] > 0.3 * -found.max()
    assert evaluation.scores["verification.rate"].value == pytest.approx(-certificate["rate_per_s"])


def test_a_field_that_does_not_is_measured_only_and_a_state_shows_it():
    model = integral(4.0, epsilon=1e-3)
    evaluation, certificate = attempt(model)
    assert certificate["claim"] == "measured_only"
    assert certificate["rate_per_s"] is None
    assert evaluation.scores["verification.contracting"].value < 1.0
    witness = evaluation.arrays["verification_witness"]
    claimed = evaluation.scores["verification.witness"].value
    assert claimed > 0
    assert largest_eigenvalues(model, witness[None])[0] == pytest.approx(claimed, rel=1e-4)


def test_behind_a_flow_the_box_is_one_of_latent_coordinates():
    _, certificate = attempt(integral(1.0, chart=schema.FlowChart(layers=2, features=8)))
    assert certificate["claim"] == "verified_on_set"
    assert set(certificate["verified_set"]) == {"lower", "upper"}


def test_the_reason_is_given_where_nothing_is_tried():
    evaluation, certificate = attempt(integral(1.0), EvaluationConfig(verify_cells=0))
    assert "verify_cells" in evaluation.omitted["verification"]
    assert certificate["claim"] == "measured_only"
    assert certificate["verified_set"] is None


def test_what_holds_by_construction_needs_no_proof():
    config = ModelConfig(schema.IdentityChart(), schema.LinearField(), schema.NoRegulariser(), seed=0)
    model = models.build(config, Geometry((0.0, 0.15), 0.15, (0.0, 0.15), (0.0, 0.1), 2.0)).eval()
    evaluation, certificate = attempt(model)
    assert certificate == certify(model, torch.from_numpy(STATES).float()).as_dict()
    assert not evaluation.scores
    assert not evaluation.omitted
