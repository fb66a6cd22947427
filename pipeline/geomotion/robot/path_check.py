"""How near a path of configurations comes to obstacles, itself and joint limits, by PyBullet's own distances."""

import functools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from geomotion.errors import ShapeMismatch
from geomotion.robot.arm import Arm
from geomotion.robot.body import BodyPoints
from geomotion.robot.panda import JointLimits
from geomotion.robot.scene import ArmScene
from geomotion.types import Float

TRAVEL_M = 0.005  # no point of a link moves farther between two looks
UP_TO_M = 0.2

Pair = tuple[str, str]
Joints = Float[np.ndarray, "row joint"]


@dataclass(frozen=True)
class Approach:
    """Where on a path two bodies are nearest to each other.

    Attributes:
        bodies: A link and an obstacle, or two links.
        distance_m: Between them, negative where they overlap [m].
        row: The row of the path nearest to that place.
    """

    bodies: Pair
    distance_m: float
    row: int


@dataclass(frozen=True)
class LimitApproach:
    """Where on a path a joint is nearest to one of its position limits.

    Attributes:
        joint: Its name.
        margin_rad: Distance to the limit, negative beyond it [rad].
        row: The row of the path.
    """

    joint: str
    margin_rad: float
    row: int


@dataclass(frozen=True)
class PathCheck:
    """What was found along a path.

    Attributes:
        obstacles: Their names.
        clearances: Of every link that ever comes within `up_to_m` of an obstacle, and that obstacle, the nearest first.
        self_clearances: The same of the pairs of links that can collide.
        limit: None if no joint has a limit.
        up_to_m: Beyond this, distances were not measured [m].
        looks: In how many configurations they were.
    """

    obstacles: tuple[str, ...]
    clearances: tuple[Approach, ...]
    self_clearances: tuple[Approach, ...]
    limit: LimitApproach | None
    up_to_m: float
    looks: int

    def as_dict(self) -> dict[str, Any]:
        """As JSON types; of the pairs of links, the nearest one."""
        return {
            "obstacles": list(self.obstacles),
            "clearances": [_as_dict(one) for one in self.clearances],
            "self_clearance": _as_dict(self.self_clearances[0]) if self.self_clearances else None,
            "limit": None if self.limit is None else vars(self.limit),
            "up_to_m": self.up_to_m,
            "looks": self.looks,
        }


def check_path(scene: ArmScene, joints_rad: Joints, up_to_m: float = UP_TO_M) -> PathCheck:
    """Lead the arm along a path, straight from row to row, and measure on the way.

    Args:
        scene: With the obstacles where they are; its arm is left at the end of the path.
        joints_rad: The path [rad].
        up_to_m: How far distances are measured [m].

    Raises:
        ShapeMismatch: If there is no row, or not one angle per joint.
    """
    arm = scene.arm
    if len(joints_rad) == 0 or joints_rad.shape[1] != len(arm.joint_names):
        raise ShapeMismatch("a path of joint positions", f"(row, {len(arm.joint_names)})", joints_rad.shape)
    to_obstacles: dict[Pair, Approach] = {}
    to_itself: dict[Pair, Approach] = {}
    places = _places(arm, joints_rad)
    rows = np.arange(len(joints_rad))
    for place in places.tolist():
        scene.set_joints(np.array([np.interp(place, rows, joint) for joint in joints_rad.T]))
        for name in scene.obstacles:
            apart = {(link, name): distance for link, distance in scene.clearances_from(name, up_to_m).items()}
            _note(to_obstacles, apart, round(place))
        _note(to_itself, scene.self_clearances(up_to_m), round(place))
    return PathCheck(
        tuple(scene.obstacles),
        _nearest_first(to_obstacles.values()),
        _nearest_first(to_itself.values()),
        _limit(arm.limits, arm.joint_names, joints_rad),
        up_to_m,
        len(places),
    )


def _places(arm: Arm, joints_rad: Joints) -> Float[np.ndarray, " look"]:
    """Rows and places between them, so that no point of a link moves farther than 5 mm from one to the next."""
    reach_m = arm.chain.reach_m(_corners(arm))
    travel_m = (np.abs(np.diff(joints_rad, axis=0)) @ reach_m).max(axis=1, initial=0.0)
    counts = np.maximum(np.ceil(travel_m / TRAVEL_M).astype(int), 1)
    between = [row + np.arange(count) / count for row, count in enumerate(counts.tolist())]
    return np.concatenate([*between, [float(len(joints_rad) - 1)]])


@functools.cache
def _corners(arm: Arm) -> BodyPoints:
    """Of the convex hulls of all links: no other points of them are farther from an axis."""
    corners_m = [shape.corners_m() for shape in arm.shapes]
    frames = [np.full(len(corners), shape.frame) for corners, shape in zip(corners_m, arm.shapes, strict=True)]
    offsets_m = np.concatenate([*corners_m, np.zeros((0, 3))])
    return BodyPoints(np.concatenate([*frames, np.zeros(0, int)]), offsets_m, np.zeros(len(offsets_m)))


def _note(found: dict[Pair, Approach], apart_m: Mapping[Pair, float], row: int) -> None:
    for bodies, distance_m in apart_m.items():
        if bodies not in found or distance_m < found[bodies].distance_m:
            found[bodies] = Approach(bodies, distance_m, row)


def _nearest_first(found: Iterable[Approach]) -> tuple[Approach, ...]:
    return tuple(sorted(found, key=lambda one: one.distance_m))


def _limit(limits: JointLimits, names: tuple[str, ...], joints_rad: Joints) -> LimitApproach | None:
    margins = np.minimum(joints_rad - limits.lower_rad, limits.upper_rad - joints_rad)
    row, joint = np.unravel_index(margins.argmin(), margins.shape)
    margin_rad = float(margins[row, joint])
    return LimitApproach(names[joint], margin_rad, int(row)) if np.isfinite(margin_rad) else None


def _as_dict(one: Approach) -> dict[str, Any]:
    return {"bodies": list(one.bodies), "distance_m": one.distance_m, "row": one.row}
