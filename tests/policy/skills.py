"""Small skills with parameters that are not the initial ones."""

import torch

from geomotion import config as schema
from geomotion import models
from geomotion.lie.poses import PoseCoordinates
from geomotion.models import ModelConfig, Skill
from geomotion.policy.policy import Policy
from geomotion.policy.training_range import TrainingRange
from geomotion.training.data import Geometry

LINEAR = ModelConfig(schema.FlowChart(layers=2, features=8), schema.LinearField(), schema.NoRegulariser(), 1)
EMBEDDED = ModelConfig(
    schema.FlowChart(layers=2, features=8), schema.LinearField(skill_dim=2), schema.NoRegulariser(), 1
)
REMEMBERING = ModelConfig(
    schema.FlowChart(layers=2, features=8),
    schema.LinearField(skill_dim=1, start_fade_durations=1.0),
    schema.NoRegulariser(),
    1,
    schema.LearnedTimeLaw(knots=5),
)
SIZE_M = 0.1
REFERENCE = (0.5, 0.5, -0.5, 0.5)


def skill_of(
    config: ModelConfig, dim: int, channels: tuple[str, ...] = ("position_m",), pose: PoseCoordinates | None = None
) -> Skill:
    centre = (0.1,) * dim
    axes = tuple(torch.eye(dim).flip(0).flatten().tolist()) if dim > 2 else ()
    geometry = Geometry(centre, SIZE_M, centre, centre, 2.0, axes=axes)
    field = models.build(config, geometry)
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for parameter in field.parameters():
            parameter.add_(0.1 * torch.randn(parameter.shape, generator=generator))
        if field.start_memory is not None:
            field.start_memory.learn(states_of(dim, 5))
            field.start_memory.remainder.fit(0.1 * SIZE_M * torch.randn(9, dim, generator=generator))
    return Skill(field.eval(), config, geometry, channels, (0,), (), pose)


def pose_skill(config: ModelConfig = EMBEDDED) -> Skill:
    return skill_of(config, 6, ("pose_m",), PoseCoordinates(torch.tensor(REFERENCE), lever_m=0.3))


def states_of(dim: int, count: int = 20) -> torch.Tensor:
    return 0.1 + SIZE_M * (2 * torch.rand(count, dim, generator=torch.Generator().manual_seed(2)) - 1)


def policy_of(skill: Skill) -> Policy:
    return Policy(skill, TrainingRange(states_of(skill.field.dim), margin_m=SIZE_M))


def defaults(policy: Policy) -> dict[str, torch.Tensor]:
    return {one.name: torch.tensor([one.default]) for one in policy.inputs if one.default is not None}


def ask(policy: Policy, **given: torch.Tensor) -> dict[str, torch.Tensor]:
    values = defaults(policy) | given
    with torch.no_grad():
        found = policy(*(values[one.name] for one in policy.inputs))
    return dict(zip((one.name for one in policy.outputs), found, strict=True))
