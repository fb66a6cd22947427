"""Conditional models: their file, what single conditions give, and what is exported."""

import numpy as np
import pytest
import torch
from torch.testing import assert_close

from geomotion import conditional_models, models
from geomotion import config as schema
from geomotion.conditional_models import ConditionalPolicy, ConditionalSkill
from geomotion.dynamics.certificate import Claim, certify
from geomotion.dynamics.conditional_certificate import for_all_conditions
from geomotion.errors import CorruptArtefact, InvalidSetting
from geomotion.export import OnnxPolicy, export_onnx
from geomotion.models import ModelConfig, Skill
from geomotion.policy.policy import Policy
from geomotion.policy.ports import Status
from geomotion.policy.training_range import TrainingRange
from geomotion.training.conditioning import Conditioning, with_conditions
from geomotion.training.data import TrainingSet

TARGETS = {"left": (0.0, 0.1), "right": (0.05, -0.1), "far": (0.2, 0.0)}
CONFIGURATIONS = {
    "linear": ModelConfig(
        schema.FlowChart(layers=2, features=8), schema.LinearField(), schema.NoRegulariser(), 1, schema.LearnedTimeLaw()
    ),
    "potential": ModelConfig(
        schema.FlowChart(layers=2, features=8), schema.PotentialField(units=6), schema.NoRegulariser(), 1
    ),
    "line integral": ModelConfig(
        schema.IdentityChart(),
        schema.LineIntegralField(hidden_units=[12], skew=True),
        schema.StateDependentRegulariser(hidden_units=[6]),
        1,
    ),
}


def demonstrations() -> TrainingSet:
    """A straight motion to each target, the longer the slower."""
    shares, durations_s = torch.linspace(0, 1, 20)[:, None], (1.0, 2.0, 4.0)
    displacements = torch.tensor(list(TARGETS.values())) - torch.tensor([-0.3, 0.2])
    return TrainingSet(
        tuple(duration_s * shares[:, 0] for duration_s in durations_s),
        tuple(torch.tensor([-0.3, 0.2]) + shares * displacement for displacement in displacements),
        tuple((one / duration_s).expand(20, -1) for one, duration_s in zip(displacements, durations_s, strict=True)),
    )


def skill_of(config: ModelConfig) -> ConditionalSkill:
    """Motions to targets, with parameters that are not the initial ones."""
    conditions = np.array(list(TARGETS.values()))
    conditioning = Conditioning.fit(
        ("x", "y"),
        TARGETS,
        conditions,
        demonstrations(),
        moves_frame=not isinstance(config.field, schema.LineIntegralField),
    )
    _, geometry = with_conditions(demonstrations(), conditions, conditioning)
    field = models.build(config, geometry).eval()
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for parameter in field.parameters():
            parameter.add_(0.1 * torch.randn(parameter.shape, generator=generator))
    return ConditionalSkill(Skill(field, config, geometry, ("position_m",), (0, 1, 2), ()), conditioning)


@pytest.fixture(params=list(CONFIGURATIONS))
def skill(request) -> ConditionalSkill:
    return skill_of(CONFIGURATIONS[request.param])


def states(count: int) -> torch.Tensor:
    return 0.1 * torch.randn(count, 2, generator=torch.Generator().manual_seed(1))


def test_it_comes_back_from_its_file(skill, tmp_path):
    conditional_models.save(tmp_path / "model.pt", skill)
    loaded = conditional_models.load(tmp_path / "model.pt")
    assert isinstance(loaded, ConditionalSkill)
    assert loaded.conditioning == skill.conditioning
    for condition in (TARGETS["far"], [0.3, -0.2]):
        assert_close(loaded.given(condition).field(states(5)), skill.given(condition).field(states(5)), rtol=0, atol=0)


def test_who_expects_no_conditions_is_told(skill, tmp_path):
    conditional_models.save(tmp_path / "model.pt", skill)
    with pytest.raises(InvalidSetting, match=r"numbers for x, y: .* conditional"):
        models.load(tmp_path / "model.pt")
    document = torch.load(tmp_path / "model.pt", weights_only=True)
    del document["conditioning"]["offset"]
    torch.save(document, tmp_path / "model.pt")
    with pytest.raises(CorruptArtefact, match="conditions"):
        conditional_models.load(tmp_path / "model.pt")


def test_a_policy_gives_each_row_the_velocity_of_its_condition(skill):
    several, elapsed_s = torch.tensor([*TARGETS.values(), (0.3, 0.3)]), torch.tensor([[0.0], [0.3], [1.0], [5.0]])
    policy = ConditionalPolicy(skill)
    steady, timed = policy(states(4), several), policy(states(4), several, elapsed_s)
    for number, condition in enumerate(several.tolist()):
        field, x = skill.given(condition).field, states(4)[number : number + 1]
        assert_close(steady[number], field(x)[0], rtol=1e-4, atol=1e-6)
        assert_close(timed[number], field.velocity(x, elapsed_s[number])[0], rtol=1e-4, atol=1e-6)


def test_given_skills_are_independent(skill):
    first = skill.given(TARGETS["left"])
    before = skill.given(TARGETS["far"]).field(states(3))
    first.field.double()
    assert_close(skill.given(TARGETS["far"]).field(states(3)), before, rtol=0, atol=0)


def test_targets_are_equilibria_of_fields_that_contract_by_construction():
    for name in ("linear", "potential"):
        skill = skill_of(CONFIGURATIONS[name])
        for target in (*TARGETS.values(), (-0.3, 0.4)):
            plain = skill.given(target)
            assert_close(plain.goal, torch.tensor(target))
            assert_close(plain.field(plain.goal), torch.zeros(2), rtol=0, atol=1e-5)


def test_one_certificate_speaks_for_all_conditions():
    skill = skill_of(CONFIGURATIONS["linear"])
    each = [certify(skill.given(condition).field, states(20)) for condition in TARGETS.values()]
    whole = for_all_conditions(each)
    assert whole.claim is Claim.by_construction
    assert whole.rate_per_s == min(one.rate_per_s for one in each) < max(one.rate_per_s for one in each)
    for condition in ([5.0, -3.0], [-1.0, 1.0]):  # also where nobody has been
        plain = skill.given(condition)
        guaranteed = skill.augmented.config.field.min_rate_per_duration * skill.augmented.config.time_law.min_speed
        assert certify(plain.field, states(20)).rate_per_s >= guaranteed / plain.geometry.duration_s
    assert whole.overshoot.worst == max(one.overshoot.worst for one in each)
    assert "under every condition" in whole.reason


def test_baselines_know_no_conditions():
    config = ModelConfig(schema.IdentityChart(), schema.VelocityNetworkField(), schema.NoRegulariser(), 0)
    with pytest.raises(InvalidSetting, match="a field that knows them"):
        skill_of(config)


@pytest.mark.usefixtures("without_shape_checks")
def test_an_exported_policy_takes_states_and_conditions(tmp_path):
    skill = skill_of(CONFIGURATIONS["linear"])
    policy = Policy(skill, TrainingRange(states(9), 0.1, torch.tensor(list(TARGETS.values())), 0.5))
    export_onnx(policy, tmp_path / "policy.onnx")
    exported = OnnxPolicy(tmp_path / "policy.onnx")
    field = ConditionalPolicy(skill)
    for count in (1, 5):
        given = {
            "state_m": states(count), "condition": 0.2 * torch.randn(count, 2), "elapsed_s": 3 * torch.rand(count, 1),
        }  # fmt: skip
        with torch.no_grad():
            expected = field(*given.values()).numpy()
        found = exported({name: values.numpy() for name, values in given.items()})
        np.testing.assert_allclose(found["velocity_m_per_s"], expected, rtol=2e-4, atol=1e-5)


def test_a_policy_says_that_a_condition_was_not_demonstrated():
    skill = skill_of(CONFIGURATIONS["linear"])
    policy = Policy(skill, TrainingRange(states(9), 0.1, torch.tensor(list(TARGETS.values())), 0.5))
    asked = torch.tensor([TARGETS["left"], (3.0, 0.0)])
    still = [torch.tensor([one.default]) for one in policy.inputs if one.default is not None]
    with torch.no_grad():
        found = policy(states(2), asked, torch.zeros(2, 1), *still)
    answer = dict(zip((one.name for one in policy.outputs), found, strict=True))
    assert answer["status"].tolist() == [Status.ok, Status.outside]
