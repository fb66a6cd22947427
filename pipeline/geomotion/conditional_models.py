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
from geomotion.dynamics.time_law import ConditionalTimeLaw, TimeLaw
from geomotion.errors import CorruptArtefact
from geomotion.models import Skill
from geomotion.training.conditioning import Conditioning
from geomotion.training.data import Geometry
from geomotion.types import Float, State, Tensor, Trajectories, Velocity


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
        return len(self.conditioning.goals[0])

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
        frame = self.conditioning.frame_at(values)
        shift = torch.tensor(frame.shift_m, dtype=torch.float32)
        field = given(deepcopy(self.augmented.field), code, shift, frame.stretch, frame.slowdown).eval()
        centre, mean = (
            tuple((frame.shift_m + frame.stretch * np.array(place[:dim])).tolist())
            for place in (geometry.centre, geometry.mean)
        )
        goal = tuple(self.conditioning.goal_at(values).tolist())
        plain = Geometry(centre, frame.stretch * geometry.scale_m, mean, goal, frame.slowdown * geometry.duration_s)
        return replace(self.augmented, field=field, geometry=plain)


class ConditionalPolicy(nn.Module):
    """ẋ = f(x, c) for states and conditions side by side: what a control loop asks for.

    Args:
        skill: The trained field.
    """

    offset: Tensor
    directions: Tensor
    shifts: Tensor
    log_units: Tensor

    def __init__(self, skill: ConditionalSkill) -> None:
        super().__init__()
        conditioning = skill.conditioning
        self.field: ChartedField = deepcopy(skill.augmented.field)
        self.dim = skill.dim
        self.condition_dim = len(conditioning.names)
        self.scale_m = skill.augmented.geometry.scale_m
        logs = torch.tensor([conditioning.log_stretches, conditioning.log_slowdowns])
        goals, moving = torch.tensor(conditioning.goals), float(conditioning.moves_frame)
        self.register_buffer("offset", torch.tensor(conditioning.offset))
        self.register_buffer("directions", torch.tensor(conditioning.directions))
        self.register_buffer("shifts", moving * goals)
        self.register_buffer("log_units", moving * logs.T)

    @property
    def time_law(self) -> TimeLaw | ConditionalTimeLaw | None:
        """That of the field."""
        return self.field.time_law

    def forward(
        self, x: State, condition: Float[Tensor, "*batch K"], elapsed_s: Float[Tensor, "*batch 1"] | None = None
    ) -> Velocity:
        """ẋ at a time since the start of the motion [s]; without one, at mean speed."""
        stretch, slowdown = self.units(condition)
        velocity: Tensor = self.field(self.augmented(x, condition), None if elapsed_s is None else elapsed_s / slowdown)
        return stretch / slowdown * velocity[..., : self.dim]

    def trajectories(
        self, start: State, condition: Float[Tensor, "*batch K"], times: Float[Tensor, "*#batch time"]
    ) -> Trajectories:
        """Where motions are at times since their start [s], only where these are known in closed form."""
        stretch, slowdown = self.units(condition)
        found = self.field.solve(self.augmented(start, condition), times / slowdown)[..., : self.dim]
        return (self._code(condition) @ self.shifts)[..., None, :] + stretch[..., None] * found

    def augmented(self, x: State, condition: Float[Tensor, "*batch K"]) -> Float[Tensor, "*batch augmented"]:
        """States of the field: in its frame, with the codes of their conditions as lengths behind them."""
        code, (stretch, _) = self._code(condition), self.units(condition)
        return torch.cat([(x - code @ self.shifts) / stretch, self.scale_m * code], -1)

    def units(
        self, condition: Float[Tensor, "*batch K"]
    ) -> tuple[Float[Tensor, "*batch 1"], Float[Tensor, "*batch 1"]]:
        """By which lengths and times are larger than in the frame of the field."""
        stretch, slowdown = (self._code(condition) @ self.log_units).exp().chunk(2, -1)
        return stretch, slowdown

    def _code(self, condition: Float[Tensor, "*batch K"]) -> Float[Tensor, "*batch R"]:
        return self.offset + condition @ self.directions


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
