"""Plans of configurations, judged by the simulator's geometry: obstacles, the arm itself, and joint limits."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from geomotion import arms
from geomotion import config as schema
from geomotion.obstacles.motion import MovingBody
from geomotion.planning.plan import Plan, PlanStatus
from geomotion.robot.grasp import GraspedCylinder
from geomotion.robot.path_check import UP_TO_M, PathCheck, check_path
from geomotion.robot.scene import GRASPED, ArmScene

SIMULATOR_EXACT_M = 5e-4  # errors of PyBullet's distances, as its tests have them
BEYOND = 2.0  # wanted clearances, up to which distances are measured


def checked(
    plans: Sequence[Plan], arm: schema.ArmConfig, config: schema.PlanningConfig, bodies: Sequence[MovingBody]
) -> tuple[list[Plan], list[PathCheck | None]]:
    """Plans of which those that fail are no longer found, and what was measured of those that were.

    Args:
        plans: Of configurations.
        arm: Whose they are.
        config: The clearance wanted, and what the hand holds.
        bodies: Obstacles, which count where they are at time zero.

    Raises:
        InvalidSetting: If there is something to hold, and no hand.
    """
    found = [number for number, plan in enumerate(plans) if plan.found]
    checks: list[PathCheck | None] = [None] * len(plans)
    judged = list(plans)
    if not found:
        return judged, checks
    with ArmScene(arms.build(arm), arms.gripper(arm)) as scene:
        if config.tool_radius_m > 0:
            scene.attach(GraspedCylinder(config.tool_radius_m, 2 * config.tool_radius_m))
        for body in bodies:
            scene.add_obstacle(body.name, body.body, body.motion.offset(0.0))
        for number in found:
            path = plans[number].path
            assert path is not None
            check = check_path(scene, path.states.vectors, max(UP_TO_M, BEYOND * config.clearance_m))
            checks[number], judged[number] = check, judge(plans[number], check, config)
    return judged, checks


def judge(plan: Plan, check: PathCheck, config: schema.PlanningConfig) -> Plan:
    """The plan, or the same without being found, and why. Soft constraints ask for no clearance, but forbid contact."""
    wanted_m = 0.0 if config.constraint is schema.ConstraintKind.soft else config.clearance_m
    if check.limit is not None and check.limit.margin_rad < 0:
        beyond = f"{check.limit.joint}, by {np.degrees(-check.limit.margin_rad):.1f} deg"
        return replace(plan, status=PlanStatus.joint_limit, reason=f"{PlanStatus.joint_limit.value}: {beyond}")
    if check.self_clearances and check.self_clearances[0].distance_m < 0:
        nearest = check.self_clearances[0]
        deep = f"{' and '.join(nearest.bodies)}, {-1000 * nearest.distance_m:.1f} mm deep"
        return replace(plan, status=PlanStatus.self_collision, reason=f"{PlanStatus.self_collision.value}: {deep}")
    # what is held is a ball to the planner, who keeps it clear, and a cylinder around that ball here
    links = [one for one in check.clearances if one.bodies[0] != GRASPED]
    near = [one for one in links if one.distance_m < wanted_m - SIMULATOR_EXACT_M]
    if near:
        link, obstacle = near[0].bodies
        apart = f"{link} and {obstacle}, {1000 * near[0].distance_m:.1f} mm where {1000 * wanted_m:.1f} mm are wanted"
        blocking = tuple(dict.fromkeys(one.bodies[1] for one in near))
        reason = f"{PlanStatus.touches.value}: {apart}"
        return replace(plan, status=PlanStatus.touches, reason=reason, blocking=blocking)
    return plan


def check_rows(check: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What was measured, in lines for people.

    Args:
        check: As a :class:`geomotion.robot.path_check.PathCheck` writes it.
    """
    clearances, own, limit = check["clearances"], check["self_clearance"], check["limit"]
    farther = f"none within {1000 * check['up_to_m']:.0f} mm"
    margin = "no limits" if limit is None else f"{np.degrees(limit['margin_rad']):.1f} deg ({limit['joint']})"
    apart = (_nearest(clearances[0]) if clearances else farther) if check["obstacles"] else "no obstacle"
    return [
        ("  links, simulated", apart),
        ("  to each other", farther if own is None else _nearest(own)),
        ("  joint limits", margin),
    ]


def _nearest(approach: Mapping[str, Any]) -> str:
    return f"{1000 * approach['distance_m']:.1f} mm ({' to '.join(approach['bodies'])})"
