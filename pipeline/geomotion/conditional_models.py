"""Models whose motion depends on a condition, and the file that any model is read from."""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import nn

from geomotion import models
from geomotion.dynamics.conditional import given
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.time_law import TimeLaw
from geomotion.errors import CorruptArtefact
from geomotion.models import Skill
from geomotion.training.conditioning import Conditioning
from geomotion.training.data import Geometry
from geomotion.types import Float, State, Tensor, Velocity


@dataclass(frozen=True)
class ConditionalSkill:
    """A trained field with a condition; each condition gives an ordinary skill.

    Attributes:
        augmented: The field of states and codes of conditions, in the frame that moves with the goal.
        conditioning: What conditions are.
    """

    augmented: Skill
    conditioning: Conditioning

    @property
    def conditions(self) -> Mapping[str, tuple[float, ...]]:
        """Conditions of the training demonstrations by name."""
        return self.conditioning.demonstrated

    @property
    def dim(self) -> int:
        """D, coordinates of a state."""
        return len(self.conditioning.goal)

    def given(self, condition: Sequence[float], key: str = "condition") -> Skill:
        """The skill for one condition, independent of this one.

        Args:
            condition: c, shape (K,).
            key: What a complaint calls it.

        Raises:
            InvalidSetting: If it does not have K finite numbers.
        """
        values = np.array(self.conditioning.checked(condition, key))
        geometry, dim = self.augmented.geometry, self.dim
        code = torch.tensor(self.conditioning.codes(values) * geometry.scale_m, dtype=torch.float32)
        shift = self.conditioning.shift_at(values)
        field = given(deepcopy(self.augmented.field), code, torch.tensor(shift, dtype=torch.float32)).eval()
        centre, mean = (tuple((place[:dim] + shift).tolist()) for place in (geometry.centre, geometry.mean))
        goal = tuple(self.conditioning.goal_at(values).tolist())
        plain = Geometry(centre, geometry.scale_m, mean, goal, geometry.duration_s)
        return replace(self.augmented, field=field, geometry=plain)


class ConditionalPolicy(nn.Module):
    """ẋ = f(x, c) for states and conditions side by side: what a control loop asks for.

    Args:
        skill: The trained field.
    """

    mean: Tensor
    directions: Tensor
    goal_slopes: Tensor

    def __init__(self, skill: ConditionalSkill) -> None:
        super().__init__()
        conditioning, scale_m = skill.conditioning, skill.augmented.geometry.scale_m
        self.field: ChartedField = deepcopy(skill.augmented.field)
        self.dim = skill.dim
        self.condition_dim = len(conditioning.names)
        slopes = torch.tensor(conditioning.goal_slopes) if conditioning.follows_goal else torch.zeros(1)
        for name, values in (
            ("mean", torch.tensor(conditioning.mean)),
            ("directions", torch.tensor(conditioning.directions)),
            ("goal_slopes", slopes),
        ):
            self.register_buffer(name, values)
        self.scale_m = scale_m
        self.follows_goal = conditioning.follows_goal

    @property
    def time_law(self) -> TimeLaw | None:
        """That of the field."""
        return self.field.time_law

    def forward(
        self, x: State, condition: Float[Tensor, "*batch K"], elapsed_s: Float[Tensor, "*batch 1"] | None = None
    ) -> Velocity:
        """ẋ at a time since the start of the motion [s]; without one, at mean speed."""
        code = (condition - self.mean) @ self.directions
        if self.follows_goal:
            x = x - code @ self.goal_slopes.T
        velocity: Tensor = self.field(torch.cat([x, self.scale_m * code], -1), elapsed_s)
        return velocity[..., : self.dim]


def save(path: Path, skill: ConditionalSkill) -> None:
    """Write a conditional model."""
    models.save(path, skill.augmented, skill.conditioning.document())


def load(path: Path) -> Skill | ConditionalSkill:
    """Read a model of either kind.

    Raises:
        CorruptArtefact: If the file is damaged or of another format.
    """
    skill, document = models.load_parts(path)
    if document is None:
        return skill
    try:
        return ConditionalSkill(skill, Conditioning.from_document(document))
    except (KeyError, TypeError) as error:
        raise CorruptArtefact(path, f"its conditions cannot be read ({error})") from error
