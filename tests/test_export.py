"""The exported policy equals the one in torch, for any number of states, and needs nothing of ours."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from geomotion import config as schema
from geomotion.export import OnnxPolicy, export_onnx
from geomotion.models import ModelConfig

from .policy.skills import LINEAR, REMEMBERING, defaults, policy_of, pose_skill, skill_of, states_of

THESIS = ModelConfig(
    schema.IdentityChart(),
    schema.LineIntegralField(hidden_units=[20, 20], skew=True),
    schema.StateDependentRegulariser(hidden_units=[8]),
    1,
)
TIMED = replace(LINEAR, time_law=schema.LearnedTimeLaw(knots=5))
SKILLS = {  # recording takes seconds each
    "potential, with a time law": lambda: skill_of(replace(TIMED, field=schema.PotentialField()), 2),
    "line integral": lambda: skill_of(THESIS, 3),
    "poses": pose_skill,
    "poses that remember their start": lambda: pose_skill(REMEMBERING),
}


def asked_of(policy, count):
    states = states_of(policy.dim, count)
    given = {policy.inputs[0].name: states, "elapsed_s": torch.linspace(0, 5, count)[:, None]}
    if policy.pose is not None:
        given["position_m"], given["orientation_wxyz"] = policy.pose.to_pose(states)
    return {one.name: given[one.name] for one in policy.inputs if one.default is None}


@pytest.mark.usefixtures("without_shape_checks")
@pytest.mark.parametrize("name", list(SKILLS))
def test_an_exported_policy_gives_the_same_answers_for_any_batch(tmp_path, name):
    policy = policy_of(SKILLS[name]())
    export_onnx(policy, tmp_path / "policy.onnx")
    exported = OnnxPolicy(tmp_path / "policy.onnx")
    for count in (1, 7):
        asked = asked_of(policy, count)
        changed = {
            "obstacle_centre_m": torch.full((1, min(policy.dim, 3)), 0.12),
            "obstacle_radius_m": torch.tensor([[0.03]]),
            "transverse_rate_per_duration": torch.tensor([[3.0]]),
            "start_position_m": torch.tensor([[0.12, 0.05, 0.14]]),
        }
        options = {key: values for key, values in changed.items() if key in defaults(policy)}
        for given in (asked, asked | options):
            values = defaults(policy) | given
            with torch.no_grad():
                expected = policy(*(values[one.name] for one in policy.inputs))
            found = exported({key: one.numpy() for key, one in given.items()})
            assert list(found) == [one.name for one in policy.outputs]
            for ours, theirs in zip(expected, found.values(), strict=True):
                np.testing.assert_allclose(theirs, ours, rtol=1e-5, atol=1e-5)
    with pytest.raises(Exception, match=r"Got: 9 Expected: "):
        exported({key: np.zeros((1, 9), np.float32) for key in asked})
