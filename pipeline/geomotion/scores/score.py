"""A score: a number with its unit, the number of points behind it and its spread."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Score:
    """One judged quantity.

    Attributes:
        value: The number (a mean, unless `statistic` says otherwise).
        unit: Its unit, ``1`` for ratios.
        count: How many values it summarises.
        spread: Standard deviation over those values (0 for one).
        statistic: What `value` is of those values: mean, max, share, …
        values: The single values, where there are few of them.
        note: What a reader has to know (scaling, grid, number of points).
    """

    value: float
    unit: str
    count: int = 1
    spread: float = 0.0
    statistic: str = "mean"
    values: tuple[float, ...] = ()
    note: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Plain types, for JSON."""
        return asdict(self)


def mean_score(values: ArrayLike | Sequence[float], unit: str, note: str = "") -> Score:
    """Mean and standard deviation of several values; keeps up to 100 of them."""
    array = np.asarray(values, dtype=float).ravel()
    kept = tuple(float(value) for value in array) if array.size <= 100 else ()
    return Score(float(array.mean()), unit, int(array.size), float(array.std()), "mean", kept, note)
