from dataclasses import replace

import numpy as np
import pytest
import torch

from geomotion import config as schema
from geomotion import models
from geomotion.export import OnnxPolicy, export_onnx
from geomotion.models import ModelConfig
from geomotion.training.data import Geometry

CONFIGURATIONS = {
    "linear in a flow": ModelConfig(schema.FlowChart(layers=2), schema.LinearField(), schema.NoRegulariser(), 1),
    "potential in a flow": ModelConfig(schema.FlowChart(layers=2), schema.PotentialField(), schema.NoRegulariser(), 1),
    "line integral": ModelConfig(
        schema.IdentityChart(), schema.LineIntegralField(hidden_units=[20, 20]), schema.ConstantRegulariser(), 1
    ),
    "line integral, asymmetric, ε of the state": ModelConfig(
        schema.IdentityChart(),
        schema.LineIntegralField(hidden_units=[20, 20], skew=True),
        schema.StateDependentRegulariser(hidden_units=[8]),
        1,
    ),
}


@pytest.mark.usefixtures("without_shape_checks")
@pytest.mark.parametrize("name", list(CONFIGURATIONS))
@pytest.mark.parametrize("dim", [2, 3])
def test_an_exported_field_gives_the_same_velocities_for_any_batch(tmp_path, name, dim):
    centre = (0.1,) * dim
    field = models.build(CONFIGURATIONS[name], Geometry(centre, 0.05, centre, centre, 2.0))
    with torch.no_grad():
        for parameter in field.parameters():
            parameter.add_(0.1 * torch.randn(parameter.shape, generator=torch.Generator().manual_seed(0)))
    export_onnx(field, tmp_path / "policy.onnx")
    policy = OnnxPolicy(tmp_path / "policy.onnx")
    for count in (1, 2, 7):
        states = torch.tensor(centre) + 0.05 * torch.randn(count, dim)
        with torch.no_grad():
            np.testing.assert_allclose(policy(states.numpy()), field(states).numpy(), rtol=2e-4, atol=1e-6)


@pytest.mark.usefixtures("without_shape_checks")
def test_an_exported_time_law_gives_the_same_velocities_at_all_times(tmp_path):
    config = replace(CONFIGURATIONS["linear in a flow"], time_law=schema.LearnedTimeLaw(knots=5))
    field = models.build(config, Geometry((0.1, 0.1), 0.05, (0.1, 0.1), (0.1, 0.1), 2.0))
    with torch.no_grad():
        field.time_law.raw_speeds.copy_(torch.linspace(-2, 2, 6))
    export_onnx(field, tmp_path / "policy.onnx")
    policy = OnnxPolicy(tmp_path / "policy.onnx")
    states, elapsed_s = 0.1 + 0.05 * torch.randn(31, 2), torch.linspace(0, 5, 31)[:, None]
    with torch.no_grad():
        np.testing.assert_allclose(
            policy(states.numpy(), elapsed_s.numpy()), field(states, elapsed_s), rtol=2e-4, atol=1e-6
        )
        assert not torch.allclose(field(states, elapsed_s), field(states), rtol=0.1)
