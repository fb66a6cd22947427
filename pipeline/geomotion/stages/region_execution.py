"""A policy in its safety region on the simulated arm: whether the arm stayed inside, with the region and without."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float

from geomotion.figures.policy_region import RegionPicture, Trace
from geomotion.obstacles.safe_field import PLANE
from geomotion.obstacles.safety_region import distance_on_grid
from geomotion.robot.recording import Tracking
from geomotion.safe_skills import SafeSkill, nearest_body_m
from geomotion.stages.executed import finite_or_none
from geomotion.stages.policy_execution import Disturbances
from geomotion.stages.policy_motion import Undisturbed

Series = Float[np.ndarray, " time"]


@dataclass(frozen=True)
class RegionRun:
    """Where an executed motion was, as its region sees it.

    Attributes:
        time_s: Since the start [s].
        codes: Latent points of the skill.
        is_inside: Whether S > ρ.
        is_supported: The same of the surroundings of the data alone.
        border_m: Distance to the border on the skill's surface, negative outside [m].
        obstacle_m: Between the tip and obstacles; infinite without any [m].
    """

    time_s: Series
    codes: Float[np.ndarray, "time 2"]
    is_inside: Bool[np.ndarray, " time"]
    is_supported: Bool[np.ndarray, " time"]
    border_m: Series
    obstacle_m: Series

    @property
    def excursions(self) -> list[dict[str, float | None]]:
        """Each time that the region was left, or begun outside of: when, and how long it took to come back [s]."""
        changes = np.diff(np.concatenate([[True], self.is_inside]).astype(int))
        left, back = self.time_s[changes < 0], self.time_s[changes > 0]
        ends = [*back.tolist(), *[None] * (len(left) - len(back))]
        return [
            {"left_s": float(begin), "back_after_s": None if end is None else end - float(begin)}
            for begin, end in zip(left, ends, strict=True)
        ]

    def document(self) -> dict[str, Any]:
        """As JSON types."""
        return {
            "inside_share": float(self.is_inside.mean()),
            "support_share": float(self.is_supported.mean()),
            "border_m": float(self.border_m.min()),
            "tip_clearance_m": finite_or_none(self.obstacle_m.min()),
            "excursions": self.excursions,
        }


@torch.no_grad()
def in_region(safe: SafeSkill, states: Float[np.ndarray, "time D"], tracking: Tracking) -> RegionRun:
    """Executed states as the region sees them."""
    codes = safe.surface.encoded(torch.from_numpy(states))
    points = torch.from_numpy(codes)
    return RegionRun(
        tracking.time_s,
        codes,
        safe.region.is_safe(points).numpy(),
        safe.support.is_safe(points).numpy(),
        safe.to_border_m(codes),
        nearest_body_m(safe.bodies, tracking.position_m),
    )


def region_document(safe: SafeSkill, led: RegionRun, free: RegionRun) -> dict[str, Any]:
    """What the region made of a motion, beside the policy as it was learned."""
    nearest = safe.nodes.grid.nearest(led.codes[led.is_inside])
    has_way = bool(np.isfinite(safe.way_to_goal[nearest]).any())
    return {"has_way_to_goal": has_way, **led.document(), "without_region": free.document()}


def region_rows(document: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The same, as names and values for people."""
    free = document["without_region"]
    rows = [
        ("in the safety region", f"{document['inside_share']:.1%} of the time ({free['inside_share']:.1%} without it)"),
        ("nearest to its border", f"{1000 * document['border_m']:.1f} mm ({1000 * free['border_m']:.1f} mm without)"),
    ]
    if document["tip_clearance_m"] is not None:
        led_mm, free_mm = (1000 * one["tip_clearance_m"] for one in (document, free))
        rows.append(("tip to the obstacle", f"{led_mm:.1f} mm ({free_mm:.1f} mm without)"))
    for one in document["excursions"]:
        after_s = one["back_after_s"]
        back = "never back" if after_s is None else f"back after {after_s:.2f} s"
        rows.append((f"outside at {one['left_s']:.2f} s", back))
    if not document["has_way_to_goal"]:
        rows.append(("way to the goal", "none from where it was: obstacles, or a lack of data between, cut it off"))
    return rows


def region_picture(
    safe: SafeSkill, alone: Undisturbed, led: RegionRun, free: RegionRun, pushes: Disturbances
) -> RegionPicture:
    """What there is to see of both runs."""
    grid, levels = safe.nodes.grid, safe.region.levels
    return RegionPicture(
        axes=np.linspace(grid.low, grid.high, grid.points_per_axis).T,
        distance=distance_on_grid(safe.reasons).reshape(grid.shape),
        levels=np.array([levels.impenetrable, levels.inactive, levels.steepness]),
        is_inside=(safe.node_clearance_m < 0).reshape(grid.shape),
        codes=safe.surface.codes,
        goal=safe.goal[0],
        undisturbed=safe.surface.encoded(torch.from_numpy(alone.states))[:, :PLANE],
        led=Trace(led.time_s, led.codes, led.border_m),
        free=Trace(free.time_s, free.codes, free.border_m),
        pushes_s=[(push.time_s, push.end_s) for push in pushes],
    )
