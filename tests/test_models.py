from dataclasses import replace

import pytest
import torch

from geomotion import config as schema
from geomotion import models
from geomotion.errors import CorruptArtefact, InvalidSetting
from geomotion.models import ModelConfig, Skill
from geomotion.training.data import Geometry

GEOMETRY = Geometry((0.1, -0.2), 0.05, (0.11, -0.19), (0.08, -0.21), 2.5)
CONFIGURATIONS = {
    "linear in a flow": ModelConfig(schema.FlowChart(), schema.LinearField(), schema.NoRegulariser(), 1),
    "potential in a flow": ModelConfig(schema.FlowChart(), schema.PotentialField(units=8), schema.NoRegulariser(), 1),
    "linear": ModelConfig(schema.IdentityChart(), schema.LinearField(), schema.NoRegulariser(), 1),
    "line integral": ModelConfig(
        schema.IdentityChart(), schema.LineIntegralField(hidden_units=[20, 20]), schema.ConstantRegulariser(), 1
    ),
    "line integral, learned parts": ModelConfig(
        schema.FlowChart(layers=2),
        schema.LineIntegralField(
            hidden_units=[20, 20], activation=schema.Activation.softplus, base_point=schema.BasePoint.learned
        ),
        schema.StateIndependentRegulariser(),
        1,
    ),
    "line integral, asymmetric, ε of the state": ModelConfig(
        schema.IdentityChart(),
        schema.LineIntegralField(hidden_units=[20, 20], skew=True),
        schema.StateDependentRegulariser(hidden_units=[8], activation=schema.Activation.softplus),
        1,
    ),
    "line integral, unconstrained": ModelConfig(
        schema.IdentityChart(),
        schema.LineIntegralField(hidden_units=[20], jacobian=schema.JacobianForm.unconstrained),
        schema.NoRegulariser(),
        1,
    ),
    "velocity network": ModelConfig(
        schema.IdentityChart(),
        schema.VelocityNetworkField(hidden_units=[20], activation=schema.Activation.silu),
        schema.NoRegulariser(),
        1,
    ),
    "SEDS": ModelConfig(schema.IdentityChart(), schema.SedsField(), schema.NoRegulariser(), 1),
    "Euclideanizing flow": ModelConfig(
        schema.FlowChart(layers=2), schema.EuclideanizingFlowField(hidden_units=[8]), schema.NoRegulariser(), 1
    ),
    "Imitation flow": ModelConfig(
        schema.FlowChart(layers=2),
        schema.ImitationFlowField(drift=schema.LatentDrift.linear),
        schema.NoRegulariser(),
        1,
    ),
    "ELCD": ModelConfig(
        schema.FlowChart(layers=2),
        schema.ElcdField(hidden_units=[8], activation=schema.Activation.silu),
        schema.NoRegulariser(),
        1,
    ),
    "line integral, eigenvalues": ModelConfig(
        schema.IdentityChart(), schema.LineIntegralField(hidden_units=[20]), schema.EigenvalueRegulariser(), 1
    ),
}


@pytest.fixture(params=list(CONFIGURATIONS))
def config(request) -> ModelConfig:
    return CONFIGURATIONS[request.param]


def disturbed(config: ModelConfig) -> Skill:
    """A model whose parameters are not the initial ones."""
    field = models.build(config, GEOMETRY).eval()
    with torch.no_grad():
        for parameter in field.parameters():
            parameter.add_(0.1 * torch.randn(parameter.shape, generator=torch.Generator().manual_seed(0)))
    return Skill(field, config, GEOMETRY, ("position_m",), (0, 1), (2,))


def test_a_saved_model_gives_the_same_velocities(config, tmp_path):
    skill = disturbed(config)
    models.save(tmp_path / "model.pt", skill)
    loaded = models.load(tmp_path / "model.pt")
    x = torch.tensor(GEOMETRY.centre) + 0.05 * torch.randn(7, 2)
    torch.testing.assert_close(loaded.field(x), skill.field(x), rtol=0, atol=0)
    assert (loaded.config, loaded.geometry, loaded.train_demos) == (skill.config, skill.geometry, skill.train_demos)


@pytest.mark.parametrize(
    ("channels", "joints"),
    [(("joints_rad",), len(GEOMETRY.goal)), (("joints_rad", "position_m"), 0), (("position_m", "joints_rad"), 0)],
)
def test_joints_are_counted_where_states_have_no_other_channel(channels, joints):
    skill = disturbed(next(iter(CONFIGURATIONS.values())))
    assert replace(skill, state_channels=channels).joints == joints


def test_the_seed_decides_the_parameters(config):
    first, second = (models.build(config, GEOMETRY).state_dict() for _ in range(2))
    for name, value in first.items():
        torch.testing.assert_close(value, second[name], rtol=0, atol=0)


def test_building_leaves_the_random_state_alone(config):
    torch.manual_seed(5)
    expected = torch.rand(1)
    torch.manual_seed(5)
    models.build(config, GEOMETRY)
    assert torch.rand(1) == expected


@pytest.mark.parametrize("damage", [lambda data: data[: len(data) // 2], lambda data: b"not a model"])
def test_a_damaged_file_is_reported(tmp_path, damage):
    path = tmp_path / "model.pt"
    models.save(path, disturbed(CONFIGURATIONS["linear in a flow"]))
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(CorruptArtefact, match=r"model\.pt"):
        models.load(path)


def test_parts_that_do_not_go_together_are_refused():
    with pytest.raises(InvalidSetting, match="regulariser"):
        models.build(ModelConfig(schema.FlowChart(), schema.LinearField(), schema.ConstantRegulariser(), 0), GEOMETRY)
    with pytest.raises(InvalidSetting, match="regulariser"):
        models.build(
            ModelConfig(schema.IdentityChart(), schema.LineIntegralField(), schema.NoRegulariser(), 0), GEOMETRY
        )


@pytest.mark.parametrize(
    "field",
    [
        schema.VelocityNetworkField(hidden_units=[4]),
        schema.LineIntegralField(hidden_units=[4], jacobian=schema.JacobianForm.unconstrained),
    ],
    ids=["network", "unconstrained"],
)
def test_a_field_without_a_negative_definite_matrix_has_no_regulariser(field):
    with pytest.raises(InvalidSetting, match="no negative definite matrix"):
        models.build(ModelConfig(schema.IdentityChart(), field, schema.ConstantRegulariser(), 0), GEOMETRY)


def test_an_unconstrained_matrix_needs_no_skew_part():
    field = schema.LineIntegralField(hidden_units=[4], jacobian=schema.JacobianForm.unconstrained, skew=True)
    with pytest.raises(InvalidSetting, match=r"field\.skew"):
        models.build(ModelConfig(schema.IdentityChart(), field, schema.NoRegulariser(), 0), GEOMETRY)


def test_a_skew_part_needs_two_coordinates():
    config = ModelConfig(schema.IdentityChart(), schema.LineIntegralField(skew=True), schema.ConstantRegulariser(), 0)
    with pytest.raises(InvalidSetting, match=r"field\.skew"):
        models.build(config, Geometry((0.1,), 0.05, (0.1,), (0.1,), 2.5))


@pytest.mark.parametrize("name", ["linear in a flow", "potential in a flow"])
def test_the_goal_is_an_equilibrium_of_a_field_that_contracts_by_construction(name):
    skill = disturbed(CONFIGURATIONS[name])
    torch.testing.assert_close(skill.field(skill.goal), torch.zeros(2), atol=1e-6, rtol=0)


def test_where_a_decoder_lies_between_codes_remember_no_start() -> None:
    """What is remembered is a state; a decoded field would not know what became of it."""
    field = schema.LinearField(skill_dim=1, start_fade_durations=1.0)
    chart = schema.InjectiveVaeChart(latent_dim=1)
    config = ModelConfig(chart, field, schema.NoRegulariser(), 1, schema.LearnedTimeLaw())
    assert models.build(config, GEOMETRY).start_memory is None
    assert models.build(models.of_codes(config), GEOMETRY).start_memory is None
    plain = replace(config, chart=schema.FlowChart())
    assert models.build(models.of_codes(plain), GEOMETRY).start_memory is not None
