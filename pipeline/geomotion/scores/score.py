"""A score: a number with its unit, the number of values behind it and their spread."""

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

VALUES_KEPT = 100


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
        """Plain types for JSON, which has no word for NaN and infinity: they become null."""
        document = asdict(self)
        document["value"] = _finite_or_none(self.value)
        document["spread"] = _finite_or_none(self.spread)
        document["values"] = [_finite_or_none(value) for value in self.values]
        return document


def summary_score(value: float, values: ArrayLike, unit: str, statistic: str, note: str = "") -> Score:
    """A named statistic of several values with their standard deviation; keeps up to 100 of the values."""
    array = np.asarray(values, dtype=float).ravel()
    kept = tuple(float(single) for single in array) if array.size <= VALUES_KEPT else ()
    with np.errstate(invalid="ignore"):  # a diverged rollout makes them infinite
        spread = float(array.std())
    return Score(float(value), unit, int(array.size), spread, statistic, kept, note)


def mean_score(values: ArrayLike, unit: str, note: str = "") -> Score:
    """Mean and standard deviation of several values."""
    return summary_score(float(np.mean(np.asarray(values, dtype=float))), values, unit, "mean", note)


def max_score(values: ArrayLike, unit: str, note: str = "") -> Score:
    """Largest of several values, with their standard deviation."""
    return summary_score(float(np.max(np.asarray(values, dtype=float))), values, unit, "max", note)


def share_score(flags: ArrayLike, note: str = "") -> Score:
    """Share of flags that are set, from 0 to 1."""
    array = np.asarray(flags, dtype=bool)
    return Score(float(array.mean()), "1", int(array.size), statistic="share", note=note)


def _finite_or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None
