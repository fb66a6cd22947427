"""Obstacles from configuration, and the field that flows around them."""

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from geomotion import config as schema
from geomotion.errors import InvalidSetting
from geomotion.models import Skill
from geomotion.obstacles.modulation import ModulatedField
from geomotion.obstacles.obstacle import Obstacle
from geomotion.obstacles.solids import Box, Ellipsoid, Sphere
from geomotion.types import Float, Tensor


def modulated(config: schema.ObstacleConfig, skill: Skill) -> ModulatedField | None:
    """The skill's field with obstacles in it, in the model's precision; nothing in free space.

    Raises:
        InvalidSetting: If an obstacle does not fit the state, or one at rest covers the goal.
    """
    match config:
        case schema.SeveralObstacles():
            bodies: list[schema.SolidObstacle] = config.bodies
        case schema.SolidObstacle():
            bodies = [config]
        case _:
            return None
    obstacles = [build_obstacle(body, skill.goal) for body in bodies]
    for body, obstacle in zip(bodies, obstacles, strict=True):
        if float(obstacle.level(skill.goal)) < 1 and not bool(obstacle.velocity.any()):
            raise InvalidSetting("obstacle.centre_m", body.centre_m, "an obstacle that leaves the goal free")
    return ModulatedField(skill.field, obstacles, config.reactivity, config.escape, config.recovery_time_s)


def build_obstacle(config: schema.SolidObstacle, like: Float[Tensor, " D"]) -> Obstacle:
    """One obstacle.

    Args:
        config: What it is.
        like: A state, for dimension and precision.

    Raises:
        InvalidSetting: If a number of coordinates does not fit the state.
    """
    dim = len(like)
    centre = _vector("centre_m", config.centre_m, like)
    velocity = None if config.velocity_m_per_s is None else _vector("velocity_m_per_s", config.velocity_m_per_s, like)
    match config:
        case schema.SphereObstacle():
            return Sphere(centre, float(config.radius_m), velocity)
        case schema.EllipsoidObstacle():
            _vector("semi_axes_m", config.semi_axes_m, like)
            return Ellipsoid(centre, config.semi_axes_m, _rotation(config.rotation_rad, dim), velocity)
        case schema.BoxObstacle():
            _vector("sides_m", config.sides_m, like)
            rounding = config.rounding_m if config.rounding_m is not None else min(config.sides_m) / 4
            return Box(centre, config.sides_m, rounding, _rotation(config.rotation_rad, dim), velocity)
        case unknown:
            raise TypeError(f"no builder for {type(unknown).__name__}")


def _vector(key: str, values: list[float], like: Float[Tensor, " D"]) -> Float[Tensor, " D"]:
    if len(values) != len(like):
        raise InvalidSetting(f"obstacle.{key}", values, f"{len(like)} numbers, one for each coordinate of the state")
    return torch.tensor(values, dtype=like.dtype)


def _rotation(rotation_rad: list[float] | None, dim: int) -> Float[Tensor, "D D"] | None:
    if rotation_rad is None:
        return None
    match dim, rotation_rad:
        case 2, [angle]:
            return torch.tensor([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]], dtype=torch.float64)
        case 3, [_, _, _]:
            return torch.tensor(Rotation.from_rotvec(rotation_rad).as_matrix())
    raise InvalidSetting("obstacle.rotation_rad", rotation_rad, "one angle in a plane, or three numbers in space")
