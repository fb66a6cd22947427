"""Fields of others and of users, from configuration."""

import pytest
import torch

from geomotion import config as schema
from geomotion import models
from geomotion.errors import InvalidSetting
from geomotion.models import ModelConfig, Skill
from geomotion.training.data import Geometry

GEOMETRY = Geometry((0.1, -0.2), 0.05, (0.11, -0.19), (0.08, -0.21), 2.5)
SOURCE = """
from torch import nn

class Decay(nn.Module):
    def __init__(self, dim, rate=1.0, spring=None):
        super().__init__()
        self.dim = dim
        self.linear = nn.Linear(dim, dim)
        self.rate = rate

    def forward(self, z):
        return -self.rate * z

class Nothing(nn.Module):
    dim = 2
    def __init__(self, dim):
        super().__init__()
"""


@pytest.fixture(scope="module")
def user_module(tmp_path_factory) -> None:
    """A module of the user's on Python's path."""
    folder = tmp_path_factory.mktemp("user")
    (folder / "decaying.py").write_text(SOURCE)
    (folder / "broken.py").write_text("import no_such_package")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        yield


def of(field: schema.AnchoredField, regulariser: schema.RegulariserConfig | None = None) -> ModelConfig:
    return ModelConfig(schema.IdentityChart(), field, regulariser or schema.NoRegulariser(), 0)


@pytest.mark.parametrize("field", [schema.SedsField(), schema.EuclideanizingFlowField(), schema.ElcdField()])
def test_the_goal_is_an_equilibrium(field):
    model = models.build(of(field), GEOMETRY)
    goal = torch.tensor(GEOMETRY.goal)
    torch.testing.assert_close(model(goal), torch.zeros(2))


def test_a_users_field_gets_its_settings_and_is_found_again(user_module, tmp_path):
    settings = {"rate": 3.0, "spring": {"kind": "stiff", "activation": "LinearField"}}  # by names that we have as well
    config = of(schema.CustomField(target="decaying.Decay", settings=settings))
    model = models.build(config, GEOMETRY).eval()
    models.save(tmp_path / "model.pt", Skill(model, config, GEOMETRY, ("position_m",), (0,), (1,)))
    skill = models.load(tmp_path / "model.pt")
    assert skill.config == config
    loaded = skill.field
    x = torch.tensor(GEOMETRY.goal) + torch.randn(5, 2)
    for one in (model, loaded):
        torch.testing.assert_close(one(x), -3.0 / 2.5 * (x - torch.tensor(GEOMETRY.goal)))


@pytest.mark.parametrize(
    ("target", "settings", "words"),
    [
        ("decaying.Decay", {"speed": 1}, "what decaying.Decay takes"),
        ("decaying.Nothing", {}, "a module with parameters"),
        ("decaying.nn", {}, "derives from torch.nn.Module"),
        ("decaying.Missing", {}, "derives from torch.nn.Module"),
        ("broken.Field", {}, "no_such_package"),
    ],
)
def test_what_is_no_field_is_refused(user_module, target, settings, words):
    with pytest.raises(InvalidSetting, match=words):
        models.build(of(schema.CustomField(target=target, settings=settings)), GEOMETRY)


@pytest.mark.parametrize("target", ["Decay", "nowhere.Decay", "not a name.Decay", "sys.Decay", "nowhere.at.all.Decay"])
def test_what_is_in_no_file_is_refused(user_module, target):
    with pytest.raises(InvalidSetting, match=r"module\.Class"):
        schema.CustomField(target=target)


def test_another_file_is_refused(user_module):
    with pytest.raises(InvalidSetting, match="has changed since"):
        schema.CustomField(target="decaying.Decay", source_sha256="0" * 64)


def test_there_is_no_regulariser_and_no_condition():
    with pytest.raises(InvalidSetting, match="regulariser"):
        models.build(of(schema.SedsField(), schema.ConstantRegulariser()), GEOMETRY)
    conditional = Geometry((0.0, 0.0, 0.5), 0.05, (0.0, 0.0, 0.5), (0.0, 0.0, 0.5), 2.5, context=1)
    with pytest.raises(InvalidSetting, match="conditions"):
        models.build(of(schema.SedsField()), conditional)
