"""The result of judging a model: scores, the arrays behind them, and what could not be judged."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from dataclasses import field as default
from typing import Any

import numpy as np
from jaxtyping import Float

from geomotion.scores.score import Score

Roll = Callable[[Float[np.ndarray, "start D"], Float[np.ndarray, " time"]], Float[np.ndarray, "start time D"]]
"""Trajectories of the judged field from several starts [m], at times after the start [s]."""


@dataclass(frozen=True)
class Unit:
    """Unit in which distances between states are reported.

    Attributes:
        name: Its name.
        per_state_unit: How many of it make one unit of the state.
    """

    name: str
    per_state_unit: float = 1.0


@dataclass(frozen=True)
class Evaluation:
    """Scores by name, arrays by name (SI units), and the reason for each score that is missing."""

    scores: dict[str, Score] = default(default_factory=dict)
    arrays: dict[str, np.ndarray] = default(default_factory=dict)
    omitted: dict[str, str] = default(default_factory=dict)

    def document(self, protocol: str, dataset: str) -> dict[str, Any]:
        """What ``scores.json`` holds."""
        return {
            "protocol": protocol,
            "dataset": dataset,
            "scores": {name: score.as_dict() for name, score in self.scores.items()},
            "omitted": self.omitted,
        }


def combine(parts: Iterable[Evaluation]) -> Evaluation:
    """All parts in one, in order."""
    whole = Evaluation()
    for part in parts:
        whole.scores.update(part.scores)
        whole.arrays.update(part.arrays)
        whole.omitted.update(part.omitted)
    return whole
