"""All figures of one evaluation."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from geomotion.figures.arrays import Arrays, EvaluationArrays, from_arrays
from geomotion.figures.eigenvalues import figure_eigenvalues
from geomotion.figures.goals import figure_goal_starts
from geomotion.figures.latent_paths import figure_latent_paths
from geomotion.figures.motion import figure_motion
from geomotion.figures.nearby import figure_nearby
from geomotion.figures.region import figure_region
from geomotion.figures.style import save_figure

PREFIXES = {
    "motion": ("demo_", "rollout_", "time_", "set_", "field_", "goal"),
    "eigenvalues": ("grid_", "true_", "claimed_", "jhat_"),
    "nearby": ("nearby_",),
    "region": ("region_",),
    "goal_starts": ("goal",),
    "latent_paths": ("latent_",),
}


def figures(data: EvaluationArrays, rate_per_s: float | None) -> dict[str, Callable[[EvaluationArrays], Figure]]:
    """Names and drawing functions of the figures that these data allow."""
    chosen: dict[str, Callable[[EvaluationArrays], Figure]] = {"motion": figure_motion}
    if data.eigenvalues is not None:
        chosen["eigenvalues"] = figure_eigenvalues
    if data.nearby is not None:
        chosen["nearby"] = partial(figure_nearby, rate_per_s=rate_per_s)
    if data.latent is not None:
        chosen["latent_paths"] = figure_latent_paths
    if data.region is not None:
        chosen["region"] = figure_region
    if data.dim == 2 and data.goal_starts is not None and not data.goal_starts.reached.all():
        chosen["goal_starts"] = figure_goal_starts
    return chosen


def save_all(arrays: Arrays, certificate: Mapping[str, Any], folder: Path) -> list[str]:
    """Draw everything that ``evaluation.npz`` holds.

    Args:
        arrays: Its arrays.
        certificate: Contents of ``certificate.json``.
        folder: Where the pictures go, each as PNG, PDF and the numbers behind it.

    Returns:
        Names of the files.

    Raises:
        MissingData: If no demonstration was judged.
        DiskFull: If space ran out.
    """
    data = from_arrays(arrays)
    names: list[str] = []
    for name, draw in figures(data, certificate.get("rate_per_s")).items():
        behind = {key: values for key, values in arrays.items() if key.startswith(PREFIXES[name])}
        names += save_figure(draw(data), folder, name, behind)
    return names
