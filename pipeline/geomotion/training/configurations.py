"""Configurations of an arm as states of a manifold."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from geomotion.robot.arm import Arm
from geomotion.robot.leading import can_lead, lead
from geomotion.scores.configurations import ConfigurationPath, ConfigurationSupport
from geomotion.scores.paths import MotionPath
from geomotion.training.states import Scaled


@dataclass(frozen=True)
class ConfigurationSpace:
    """Place and size of demonstrated configurations; a :class:`geomotion.training.states.StateSpace`.

    Attributes:
        centre_rad: Mean configuration.
        scale_rad: Root mean square distance to it: one scale for all joints.
        scale_m: The same of the end effector's positions.
        arm: Whose joints these are.
    """

    centre_rad: tuple[float, ...]
    scale_rad: float
    scale_m: float
    arm: Arm = field(repr=False, compare=False)

    @classmethod
    def of(cls, paths: Sequence[ConfigurationPath], arm: Arm) -> "ConfigurationSpace":
        """Measure demonstrations."""
        joints, positions = (
            np.concatenate(parts) for parts in zip(*((p.joints_rad, p.position_m) for p in paths), strict=True)
        )
        return cls(tuple(joints.mean(axis=0).tolist()), _spread(joints), _spread(positions), arm)

    @property
    def joints(self) -> int:
        """η."""
        return len(self.centre_rad)

    def scaled(self, path: MotionPath) -> Scaled:
        """Configurations as the network sees them."""
        return np.asarray((path.vectors - self.centre_rad) / self.scale_rad)

    def path(self, scaled: Scaled) -> ConfigurationPath:
        """The configurations that a network means."""
        return configurations(scaled * self.scale_rad + self.centre_rad, self.arm)

    def separation(self, states: MotionPath, one: MotionPath) -> Float[np.ndarray, " state"]:
        """Distances of configurations to one, in units of the scale."""
        return np.asarray(np.linalg.norm(states.vectors - one.vectors, axis=1) / self.scale_rad)

    def allows(self, states: MotionPath) -> Bool[np.ndarray, " state"]:
        """Whether joints are within their limits."""
        return np.asarray(self.arm.limits.margin_rad(states.vectors) >= 0)

    def support(self, demonstrations: Sequence[MotionPath]) -> ConfigurationSupport:
        """Demonstrated configurations, ready for queries."""
        return ConfigurationSupport.of(demonstrations)

    def document(self) -> dict[str, Any]:
        """As JSON types, without the arm."""
        return {"centre_rad": list(self.centre_rad), "scale_rad": self.scale_rad, "scale_m": self.scale_m}


def configurations(joints_rad: Float[np.ndarray, "state joint"], arm: Arm) -> ConfigurationPath:
    """Configurations of an arm, whose hand can be led where it has joints enough."""
    return ConfigurationPath(joints_rad, arm.chain.pose, partial(lead, arm) if can_lead(arm) else None)


def _spread(values: Float[np.ndarray, "state D"]) -> float:
    return float(np.sqrt(np.square(values - values.mean(axis=0)).sum(axis=1).mean()))
