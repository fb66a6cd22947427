"""Motions of a hand the way people repeat them, and the simulated Panda that is led along.

A repetition starts and ends a little elsewhere, takes a slightly different way, turns a little sooner or later, and
is faster or slower as a whole. In time it follows a minimum-jerk law, slower where the way is curved (two-thirds power
law).

Source:
    T. Flash, N. Hogan, The coordination of arm movements, J. Neurosci. 5(7), 1985;
    P. Viviani, T. Flash, Minimum-jerk, two-thirds power law, and isochrony, J. Exp. Psychol. 21(1), 1995.
"""

from dataclasses import dataclass

import numpy as np

from geomotion.config import GeneratedDataset
from geomotion.demos.demonstrations import Array, Trajectory
from geomotion.demos.orientations import continuous_in_sign
from geomotion.errors import InvalidSetting

Quaternion = tuple[float, float, float, float]  # w, x, y, z

PATH_POINTS = 2000
LEAD_IN_POSES = 20
WAVES = 4
DURATION_SPREAD = 0.12
ONSET_SPREAD = 0.03  # of the way, by which a turn begins and ends sooner or later
ONSET_LIMIT = 0.1
LEVER_M = 0.2  # turning by a radian takes as long as moving by this
CURVATURE_FLOOR_PER_M = 3.0  # straighter parts are not passed faster
FRAME = "base of the simulated Panda (franka_panda/panda.urdf of pybullet_data); poses of its grasp target"
LED = "led the simulated arm along intended poses; joints_rad are derived from them by inverse kinematics"


@dataclass(frozen=True)
class Intent:
    """What a hand is meant to do: pass places in a row, and turn on the way.

    Attributes:
        rest_m: Where it comes from, oriented as at the start, shape (3,) [m].
        places_m: Places to pass, shape (place, 3) [m].
        start_wxyz: Orientation at the first place.
        end_wxyz: Orientation at the last place.
        turn: Shares of the way between which the hand turns from one to the other, by the shortest rotation.
        label: Name of the demonstration.
    """

    rest_m: Array
    places_m: Array
    start_wxyz: Quaternion
    end_wxyz: Quaternion
    turn: tuple[float, float]
    label: str


@dataclass(frozen=True)
class Spread:
    """Standard deviation per axis at the start, half-way, and at the end."""

    start: float
    middle: float
    end: float


@dataclass(frozen=True)
class Habits:
    """How much repetitions differ: position [m] and orientation [rad]."""

    position_m: Spread
    orientation_rad: Spread


def lead_the_arm(intent: Intent, habits: Habits, config: GeneratedDataset, number: int) -> Trajectory:
    """Repetition `number` of a motion, as the simulated arm records it.

    ``position_m`` [m] and ``orientation_wxyz`` are poses of the grasp target in the base frame, computed from the
    joint positions that inverse kinematics finds for the intended poses; ``joints_rad`` [rad] are those. The arm comes
    from one rest pose, so that it follows all motions with its elbow on the same side.

    Raises:
        InvalidSetting: If the variation asked for leads out of the arm's reach or beyond its joint limits.
    """
    from geomotion.robot.inverse_kinematics import solve_path

    time_s, position_m, orientation_wxyz = repeat(intent, habits, config, number)
    lead_in = np.linspace(intent.rest_m, position_m[0], LEAD_IN_POSES, endpoint=False)
    path = solve_path(
        np.concatenate([lead_in, position_m]),
        np.concatenate([np.tile(intent.start_wxyz, (LEAD_IN_POSES, 1)), orientation_wxyz]),
        "grasp_target",
    )
    if path.unreachable:
        expected = f"less: demonstration {number} leads out of the arm's reach"
        raise InvalidSetting("dataset.variation", config.variation, expected)
    return recorded(time_s, path.joints_rad[LEAD_IN_POSES:], orientation_wxyz, intent.label)


def recorded(time_s: Array, joints_rad: Array, near_wxyz: Array, label: str) -> Trajectory:
    """What the simulated arm records: joints, and poses of its grasp target, quaternions of the sign of those near."""
    from geomotion.robot.chain import panda_chain

    position_m, reached_wxyz = panda_chain("grasp_target").pose(joints_rad)
    signs = np.where(np.einsum("ti,ti->t", reached_wxyz, near_wxyz) < 0, -1.0, 1.0)
    channels = {
        "position_m": position_m,
        "orientation_wxyz": reached_wxyz * signs[:, None],
        "joints_rad": joints_rad,
    }
    return Trajectory(time_s, channels, label)


def repeat(intent: Intent, habits: Habits, config: GeneratedDataset, number: int) -> tuple[Array, Array, Array]:
    """Times [s], positions [m] and orientations (wxyz, continuous in sign) of repetition `number` of a motion.

    The same seed and number give the same repetition, whatever else is generated.
    """
    from scipy.spatial.transform import Rotation

    generator = np.random.default_rng((config.seed, number))
    way = np.linspace(0.0, 1.0, PATH_POINTS)
    duration_s = config.duration_s * float(np.exp(config.variation * DURATION_SPREAD * generator.standard_normal()))
    onset = np.clip(config.variation * ONSET_SPREAD * generator.standard_normal(), -ONSET_LIMIT, ONSET_LIMIT)
    places = _through(intent.places_m, way) + config.variation * wander(way, habits.position_m, generator)
    wobble = config.variation * wander(way, habits.orientation_rad, generator)
    start = Rotation.from_quat(intent.start_wxyz, scalar_first=True)
    turn = (Rotation.from_quat(intent.end_wxyz, scalar_first=True) * start.inv()).as_rotvec()
    begin, end = intent.turn
    turns = np.outer(minimum_jerk(np.clip((way - begin - onset) / (end - begin), 0.0, 1.0)), turn)
    passed = effort(np.concatenate([places, LEVER_M * (turns + wobble)], axis=1))
    now = np.interp(minimum_jerk(np.linspace(0.0, 1.0, config.points)), passed, way)
    rotation = Rotation.from_rotvec(_at(now, way, wobble)) * Rotation.from_rotvec(_at(now, way, turns)) * start
    time_s = np.linspace(0.0, duration_s, config.points)
    return (
        time_s,
        _at(now, way, places),
        continuous_in_sign(rotation.as_quat(scalar_first=True), np.array(intent.start_wxyz)),
    )


def turned(wxyz: Quaternion, *turns_rad: tuple[float, float, float]) -> Quaternion:
    """An orientation after turns about axes of the base frame, given as rotation vectors [rad], one after the other."""
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_quat(wxyz, scalar_first=True)
    for turn_rad in turns_rad:
        rotation = Rotation.from_rotvec(turn_rad) * rotation
    w, x, y, z = rotation.as_quat(scalar_first=True)
    return float(w), float(x), float(y), float(z)


def minimum_jerk(progress: Array) -> Array:
    """Share of the way at a share of the time, at rest with zero acceleration at both ends."""
    return np.asarray(10 * progress**3 - 15 * progress**4 + 6 * progress**5)


def effort(path: Array) -> Array:
    """Share of the time needed up to each point of a path of shape (point, axes) [m] at constant pace, from 0 to 1.

    Time is ∫ max(curvature, floor)^{1/3} ds: speed falls with the cube root of curvature.
    """
    d1 = np.gradient(path, axis=0)
    d2 = np.gradient(d1, axis=0)
    speed = np.linalg.norm(d1, axis=1)
    along = np.einsum("ti,ti->t", d1, d2) / speed
    curvature = np.sqrt(np.maximum(np.einsum("ti,ti->t", d2, d2) - along**2, 0.0)) / speed**2
    density = np.hypot(curvature, CURVATURE_FLOOR_PER_M) ** (1 / 3) * speed
    passed = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2)])
    return np.asarray(passed / passed[-1])


def _through(places_m: Array, way: Array) -> Array:
    """Cubic spline through places at shares of the way, by the distances between them, shape (point, 3) [m]."""
    from scipy.interpolate import CubicSpline

    passed = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places_m, axis=0), axis=1))])
    return np.asarray(CubicSpline(passed / passed[-1], places_m, bc_type="natural")(way))


def wander(way: Array, spread: Spread, generator: np.random.Generator, axes: int = 3) -> Array:
    """A smooth random departure from the way, shape (point, axes): from offset to offset, and a few waves between them.

    The waves are the first terms of the Karhunen–Loève series of a bridge, of standard deviation about 1 half-way.
    """
    start, end = generator.standard_normal((2, axes))
    numbers = np.arange(1, WAVES + 1)
    waves = np.sin(np.pi * np.outer(way, numbers)) @ (generator.standard_normal((WAVES, axes)) / numbers[:, None] ** 2)
    ends = np.outer(1 - way, spread.start * start) + np.outer(way, spread.end * end)
    return np.asarray(ends + spread.middle * waves)


def _at(now: Array, way: Array, values: Array) -> Array:
    return np.stack([np.interp(now, way, axis) for axis in values.T], axis=1)
