"""How long rollouts from anywhere stay where the demonstrations are (thesis Sec. 6.4, Eq. (6.10), Table 5.3)."""

from dataclasses import dataclass

import numpy as np
import shapely
from jaxtyping import Bool, Float

from geomotion.scores.evaluation import Evaluation, Roll
from geomotion.scores.grids import Box, sample_box
from geomotion.scores.score import mean_score


@dataclass(frozen=True)
class RegionProtocol:
    """How (6.10) is evaluated.

    Attributes:
        starts_per_axis: Rollouts start on an equidistant grid with this many points per axis.
        steps: Points of each rollout, its start included.
        step_s: Time between them [s].
        margin_m: Distance by which the convex hull is widened [m].
    """

    starts_per_axis: int
    steps: int
    step_s: float
    margin_m: float


def demonstration_region(points: Float[np.ndarray, "point 2"], margin_m: float) -> shapely.Geometry:
    """Convex hull of the points, widened by a margin."""
    hull = shapely.MultiPoint(points).convex_hull
    return hull.buffer(margin_m) if margin_m > 0 else hull


def inside(region: shapely.Geometry, trajectories: Float[np.ndarray, "start time 2"]) -> Bool[np.ndarray, "start time"]:
    """Which states lie in the region; states that are not finite do not."""
    shapely.prepare(region)
    return np.asarray(shapely.contains_xy(region, trajectories[..., 0], trajectories[..., 1]))


def judge_region(
    roll: Roll, demonstrated: Float[np.ndarray, "point D"], box: Box, protocol: RegionProtocol
) -> Evaluation:
    """Steps inside and outside the region of the demonstrations, in two dimensions only.

    Args:
        roll: The judged field's trajectories.
        demonstrated: Demonstrated states [m].
        box: Where rollouts start.
        protocol: Numbers of starts and steps, step, margin.

    Source:
        Thesis Eq. (6.10); Table 5.3 counts the steps outside.
    """
    if box.dim != 2:
        return Evaluation(omitted={"region": f"Eq. (6.10) is evaluated in two dimensions; the state has {box.dim}"})
    region = demonstration_region(demonstrated, protocol.margin_m)
    if region.geom_type != "Polygon":
        return Evaluation(omitted={"region": "the demonstrations lie on a line; set evaluation.region_margin above 0"})
    starts = sample_box(box, protocol.starts_per_axis, seed=0)
    trajectories = roll(starts.points, protocol.step_s * np.arange(protocol.steps))
    is_inside = inside(region, trajectories)
    steps_inside = is_inside.sum(axis=1)
    note = (
        f"of {protocol.steps} steps of {1000 * protocol.step_s:.3g} ms (mean duration / mean number of points of a "
        f"demonstration); starts: {starts.note}; convex hull widened by {1000 * protocol.margin_m:.3g} mm"
    )
    return Evaluation(
        {
            "region.steps_inside": mean_score(steps_inside, "steps", note),
            "region.steps_outside": mean_score(protocol.steps - steps_inside, "steps", note),
        },
        {
            "region_hull": shapely.get_coordinates(region.exterior),
            "region_rollouts": trajectories,
            "region_inside": is_inside,
        },
    )
