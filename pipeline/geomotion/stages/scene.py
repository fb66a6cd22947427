"""Obstacles from configuration, and the field that flows around them."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from geomotion import config as schema
from geomotion.dynamics.fields import VectorField
from geomotion.errors import InvalidSetting
from geomotion.models import Skill
from geomotion.obstacles.body import Body
from geomotion.obstacles.boundary import Boundary
from geomotion.obstacles.enclosure import enclose
from geomotion.obstacles.modulation import ModulatedField
from geomotion.obstacles.motion import ConstantVelocity, Motion, MovingBody, Waypoints
from geomotion.obstacles.obstacle import Obstacle, overlap
from geomotion.obstacles.solids import SPACE, Box, Ellipsoid, Sphere
from geomotion.obstacles_files import Placement, load_mesh, load_point_cloud, load_triangles
from geomotion.types import Float, Tensor

SHARP = 0.01  # rounding of edges, of the shortest side


def modulated(config: schema.ObstacleConfig, skill: Skill) -> ModulatedField | None:
    """The skill's field with obstacles in it, in the model's precision; nothing in free space.

    Raises:
        InvalidSetting: If an obstacle does not fit the state, or one at rest covers the goal.
    """
    return around_obstacles(config, skill.field, skill.goal, space_of(config, skill))


def space_of(config: schema.ObstacleConfig, skill: Skill) -> int:
    """How many of the first coordinates of a state are the position that obstacles stand in the way of.

    Raises:
        InvalidSetting: If there are obstacles, and a state begins with joints and ends with a pose.
    """
    if skill.pose is None:
        return len(skill.goal)
    if skill.joints and solids(config):
        raise InvalidSetting("obstacle", "beside joints", "free: these states begin with joints, not with a position")
    return SPACE


def around_obstacles(
    config: schema.ObstacleConfig, field: VectorField, goal: Float[Tensor, " D"], space: int
) -> ModulatedField | None:
    """A field with obstacles in it; nothing in free space.

    Args:
        config: The obstacles.
        field: In the precision of the goal.
        goal: Where it leads.
        space: How many of the first coordinates are the position that obstacles stand in the way of.

    Raises:
        InvalidSetting: If an obstacle does not fit the state, or one at rest covers the goal.
    """
    bodies = solids(config)
    if not isinstance(config, schema.Avoidance) or not bodies:
        return None
    position, held = goal[:space], goal[space:]
    obstacles = [_avoidable(body, position) for body in bodies]
    for body, obstacle in zip(bodies, obstacles, strict=True):
        if float(obstacle.level(position)) < 1 and not bool(obstacle.velocity.any()):
            raise InvalidSetting("obstacle.centre_m", body.centre_m, "an obstacle that leaves the goal free")
    _refuse_overlaps(obstacles)
    options = (config.reactivity, config.escape, config.recovery_time_s, config.hold)
    return ModulatedField(field, obstacles, *options, held=held if len(held) else None)


def grown(config: schema.ObstacleConfig, by_m: float) -> schema.ObstacleConfig:
    """The same obstacles with everything inside them that is nearer than a length [m], for points of larger bodies."""
    match config:
        case schema.SeveralObstacles():
            return replace(config, bodies=[grown(body, by_m) for body in solids(config)])
        case schema.SphereObstacle():
            return replace(config, radius_m=config.radius_m + by_m)
        case schema.EllipsoidObstacle():
            # a convex body holds its inner ball: as much larger as that one grows, it contains all that is near
            factor = 1 + by_m / min(config.semi_axes_m)
            return replace(config, semi_axes_m=[factor * length for length in config.semi_axes_m])
        case schema.BoxObstacle():
            rounding = config.rounding_m if config.rounding_m is not None else min(config.sides_m) / 4
            return replace(config, sides_m=[side + 2 * by_m for side in config.sides_m], rounding_m=rounding + by_m)
        case schema.MeshObstacle() if by_m > 0:
            return replace(config, rounding_m=(config.rounding_m or 0.0) + by_m)
        case _:
            return config


def _avoidable(config: schema.SolidObstacle, like: Float[Tensor, " D"]) -> Obstacle:
    """An obstacle that fields go around."""
    if isinstance(config, schema.PointCloudObstacle) or config.path_m is not None:
        expected = "a body with a surface, at rest or with constant velocity: fields go around those"
        raise InvalidSetting("obstacle", _kind(config), expected)
    if isinstance(config, schema.MeshObstacle):
        _require_dimension(config, 3, len(like))
        vertices, faces = load_triangles(Path(config.file))
        boundary = Boundary.of_mesh(_placement(config).apply(vertices), faces)
        velocity = _velocity(config, like)
        return enclose(boundary, config.rounding_m, config.convex_hull, velocity).to(like)
    body = build_obstacle(config, like)
    assert isinstance(body, Obstacle)
    return body


def _refuse_overlaps(obstacles: Sequence[Obstacle]) -> None:
    """Where two surfaces meet, a state on one is carried into the other.

    Raises:
        InvalidSetting: If two obstacles overlap at time zero.
    """
    for one, other in permutations(range(len(obstacles)), 2):
        if overlap(obstacles[one], obstacles[other]):
            raise InvalidSetting(
                "obstacle.bodies",
                f"number {one + 1} and {other + 1} of {len(obstacles)} overlap",
                "bodies apart from each other; make those that belong together one, as a star-shaped polygon or mesh",
            )


def solids(config: schema.ObstacleConfig) -> list[schema.SolidObstacle]:
    """The bodies of a configuration; none in free space."""
    match config:
        case schema.SeveralObstacles():
            return list(config.bodies)
        case schema.SolidObstacle():
            return [config]
        case _:
            return []


def moving_bodies(config: schema.ObstacleConfig, dim: int) -> list[MovingBody]:
    """Obstacles with names and motions, for planning in a space of `dim` axes.

    Raises:
        InvalidSetting: If a number of coordinates does not fit, or a mesh is asked for in a plane.
        MissingData: If a file does not exist.
        DatasetError: If a file holds no usable mesh or points.
    """
    like = torch.zeros(dim, dtype=torch.float64)
    found = []
    bodies = solids(config)
    for number, one in enumerate(bodies):
        kind = _kind(one)
        name = kind if sum(_kind(other) == kind for other in bodies) == 1 else f"{kind} {number}"
        body = build_obstacle(_sharp(one), like)
        found.append(MovingBody(name, body, _motion(one, dim)))
    return found


def _kind(config: schema.SolidObstacle) -> str:
    return type(config).__name__.removesuffix("Obstacle").replace("PointCloud", "point cloud").lower()


def _sharp(config: schema.SolidObstacle) -> schema.SolidObstacle:
    """Boxes as sharp as they can be: rounding serves the smoothness of fields, not of paths."""
    if isinstance(config, schema.BoxObstacle) and config.rounding_m is None:
        return replace(config, rounding_m=SHARP * min(config.sides_m))
    return config


def _motion(config: schema.SolidObstacle, dim: int) -> Motion:
    if config.path_m is not None:
        places = np.array([_vector("path_m", place, torch.zeros(dim)).tolist() for place in config.path_m])
        return Waypoints(
            np.asarray(config.path_times_s, dtype=float), places - np.asarray(config.centre_m, dtype=float)
        )
    velocity = config.velocity_m_per_s
    return ConstantVelocity(np.zeros(dim) if velocity is None else np.asarray(velocity, dtype=float))


def build_obstacle(config: schema.SolidObstacle, like: Float[Tensor, " D"]) -> Body:
    """One obstacle.

    Args:
        config: What it is.
        like: A state, for dimension and precision.

    Raises:
        InvalidSetting: If a number of coordinates does not fit the state.
    """
    dim = len(like)
    centre = _vector("centre_m", config.centre_m, like)
    velocity = _velocity(config, like)
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
        case schema.PolygonObstacle():
            _require_dimension(config, 2, dim)
            turn = _rotation(config.rotation_rad, dim)
            corners = np.array(config.vertices_m, dtype=float) @ (np.eye(2) if turn is None else turn.numpy().T)
            boundary = Boundary.of_polygon(corners + np.array(config.centre_m))
            return enclose(boundary, config.rounding_m, config.convex_hull, velocity).to(like)
        case schema.MeshObstacle() | schema.PointCloudObstacle():
            return _from_file(config, dim)
        case unknown:
            raise TypeError(f"no builder for {type(unknown).__name__}")


def _from_file(config: schema.MeshObstacle | schema.PointCloudObstacle, dim: int) -> Body:
    _require_dimension(config, 3, dim)
    if isinstance(config, schema.MeshObstacle):
        return load_mesh(Path(config.file), _placement(config))
    return load_point_cloud(Path(config.file), config.radius_m, _placement(config))


def _placement(config: schema.MeshObstacle | schema.PointCloudObstacle) -> Placement:
    turn: Sequence[float] = config.rotation_rad if config.rotation_rad is not None else (0.0, 0.0, 0.0)
    if len(turn) != 3:
        raise InvalidSetting("obstacle.rotation_rad", turn, "three numbers, a rotation vector")
    place = tuple(float(value) for value in config.centre_m)
    return Placement(config.scale, (turn[0], turn[1], turn[2]), (place[0], place[1], place[2]))


def _require_dimension(config: schema.SolidObstacle, needed: int, dim: int) -> None:
    if dim != needed:
        expected = f"a sphere, ellipsoid or box: it has {needed} coordinates, the state {dim}"
        raise InvalidSetting("obstacle", _kind(config), expected)


def _velocity(config: schema.SolidObstacle, like: Float[Tensor, " D"]) -> Float[Tensor, " D"] | None:
    return None if config.velocity_m_per_s is None else _vector("velocity_m_per_s", config.velocity_m_per_s, like)


def files(config: schema.ObstacleConfig) -> list[Path]:
    """The files that obstacles are read from."""
    from_files = schema.MeshObstacle | schema.PointCloudObstacle
    return [Path(body.file) for body in solids(config) if isinstance(body, from_files)]


def _vector(key: str, values: Any, like: Float[Tensor, " D"]) -> Float[Tensor, " D"]:
    if not _are_numbers(values) or len(values) != len(like):
        raise InvalidSetting(f"obstacle.{key}", values, f"{len(like)} numbers, one for each coordinate of the state")
    return torch.tensor(values, dtype=like.dtype)


def _are_numbers(values: object) -> bool:
    """Whether this is a list of numbers: what stands in a list of lists is not checked when a command is read."""
    return isinstance(values, list) and all(isinstance(value, int | float) for value in values)


def _rotation(rotation_rad: list[float] | None, dim: int) -> Float[Tensor, "D D"] | None:
    if rotation_rad is None:
        return None
    match dim, rotation_rad:
        case 2, [angle]:
            return torch.tensor([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]], dtype=torch.float64)
        case 3, [_, _, _]:
            return torch.tensor(Rotation.from_rotvec(rotation_rad).as_matrix())
    raise InvalidSetting("obstacle.rotation_rad", rotation_rad, "one angle in a plane, or three numbers in space")
