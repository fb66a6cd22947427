"""Handwriting-like letters: no download needed, and nobody's recordings.

A letter is a smooth stroke that does not cross itself, so that an autonomous first-order field can follow it. A
repetition bends the whole plane by a smooth one-to-one map that keeps the end point fixed: it starts elsewhere, looks
different, ends at the same point and still never crosses itself. It is written the way hands move: slower in curves
(two-thirds power law) and at rest at both ends (minimum jerk).

Source:
    P. Viviani, T. Flash, Minimum-jerk, two-thirds power law, and isochrony, J. Exp. Psychol. 21(1), 1995;
    T. Flash, N. Hogan, The coordination of arm movements, J. Neurosci. 5(7), 1985.
"""

import numpy as np

from geomotion.config import LettersDataset
from geomotion.demos.conditions import conditioned
from geomotion.demos.demonstrations import Array, Demonstrations, Trajectory
from geomotion.demos.generators.provenance import generated

# Control polygons of the strokes, in units of the letter's height; the last point becomes the origin.
POLYGONS: dict[str, tuple[tuple[float, float], ...]] = {
    "c": ((0.75, 0.85), (0.45, 1.15), (-0.10, 0.95), (-0.10, 0.05), (0.45, -0.15), (0.80, 0.20)),
    "j": ((0.60, 1.00), (0.62, 0.70), (0.62, 0.30), (0.58, -0.20), (0.05, -0.20), (0.00, 0.20)),
    "l": ((0.00, 1.00), (0.00, 0.65), (0.00, 0.25), (0.05, -0.05), (0.25, 0.00), (0.45, 0.02), (0.70, 0.00)),
    "n": ((0.00, 0.00), (0.00, 0.50), (0.05, 1.25), (0.65, 1.25), (0.70, 0.50), (0.70, 0.00)),
    "s": (
        (0.65, 0.90), (0.35, 1.15), (-0.15, 0.95), (0.00, 0.50), (0.65, 0.50), (0.80, 0.00), (0.35, -0.15),
        (0.00, 0.10),
    ),
    "sine": ((0.00, 0.40), (0.15, 0.80), (0.40, 1.20), (0.70, 0.40), (1.00, -0.40), (1.25, 0.00), (1.40, 0.40)),
    "u": ((0.00, 1.00), (0.00, 0.50), (0.05, -0.25), (0.65, -0.25), (0.70, 0.50), (0.70, 1.00)),
    "v": ((0.00, 1.00), (0.16, 0.60), (0.30, 0.10), (0.42, -0.35), (0.54, 0.10), (0.68, 0.60), (0.84, 1.00)),
    "w": (
        (0.00, 1.00), (0.10, 0.50), (0.22, -0.30), (0.42, -0.10), (0.55, 1.10),
        (0.68, -0.10), (0.88, -0.30), (1.00, 0.50), (1.10, 1.00),
    ),
    "z": (
        (0.00, 1.00), (0.40, 1.00), (0.75, 1.00), (0.75, 0.90), (0.40, 0.50), (0.00, 0.10), (0.00, 0.00), (0.35, 0.00),
        (0.75, 0.00),
    ),
}  # fmt: skip
STROKE_POINTS = 2000
WAVES = 6
WAVELENGTHS = (1.5, 5.0)  # of the bends, in heights
BEND_SLOPE = 0.3  # largest slope of a bend for variation 1; below 1 for the largest variation allowed
TURN_SPREAD_RAD = 0.06
SIZE_SPREAD = 0.06
DURATION_SPREAD = 0.12
CURVATURE_FLOOR = 2.0  # per height: straighter parts are not written faster
WHAT = "handwriting-like letters"


def generate(config: LettersDataset) -> Demonstrations:
    """Write the letter of `config` several times: ``position_m`` [m], ending at the origin.

    The same configuration gives the same demonstrations; a demonstration does not depend on how many follow it.
    """
    letters = [config.letter, *config.further_letters]
    written = {letter: _write(letter, config) for letter in letters}
    trajectories, condition_names = conditioned(written, config.condition, config.targets_m)
    return generated(
        config,
        trajectories,
        WHAT,
        choice=f"letter {' + '.join(letters)}",
        space="R2",
        frame="drawing plane, origin at the target",
        condition_names=condition_names,
    )


def _write(letter: str, config: LettersDataset) -> list[Trajectory]:
    stroke = _stroke(POLYGONS[letter])
    generators = [np.random.default_rng((config.seed, number)) for number in range(config.demos)]
    return [_repeat(stroke, config, generator) for generator in generators]


def _stroke(polygon: tuple[tuple[float, float], ...]) -> Array:
    """Cubic B-spline along a control polygon, moved to end at the origin, shape (point, 2) [heights]."""
    from scipy.interpolate import BSpline

    points = np.array(polygon)
    inner = np.linspace(0.0, 1.0, len(points) - 2)
    knots = np.concatenate([[0.0] * 3, inner, [1.0] * 3])
    stroke = BSpline(knots, points - points[-1], 3)(np.linspace(0.0, 1.0, STROKE_POINTS))
    return np.asarray(stroke, dtype=np.float64)


def _repeat(stroke: Array, config: LettersDataset, generator: np.random.Generator) -> Trajectory:
    shape = _bend(_turn(stroke, config.variation, generator), config.variation, generator)
    duration_s = config.duration_s * float(np.exp(config.variation * DURATION_SPREAD * generator.standard_normal()))
    pace = _minimum_jerk(np.linspace(0.0, 1.0, config.points))
    effort = _effort(shape)
    position = np.stack([np.interp(pace, effort, coordinate) for coordinate in shape.T], axis=1)
    return Trajectory(np.linspace(0.0, duration_s, config.points), {"position_m": config.size_m * position})


def _turn(stroke: Array, variation: float, generator: np.random.Generator) -> Array:
    """Turn and stretch about the end point."""
    angle = variation * TURN_SPREAD_RAD * generator.standard_normal()
    size = np.exp(variation * SIZE_SPREAD * generator.standard_normal())
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.asarray(size * stroke @ np.array([[cosine, sine], [-sine, cosine]]))


def _bend(points: Array, variation: float, generator: np.random.Generator) -> Array:
    """Move points by a sum of plane waves that vanishes at the origin.

    The slopes of the waves add up to ``BEND_SLOPE * variation`` < 1, so that x ↦ x + bend(x) is one-to-one.
    """
    direction = _unit_vectors(generator)
    wave_vectors = 2 * np.pi / generator.uniform(*WAVELENGTHS, size=(WAVES, 1)) * _unit_vectors(generator)
    phases = generator.uniform(0.0, 2 * np.pi, size=WAVES)
    amplitudes = variation * BEND_SLOPE / WAVES / np.linalg.norm(wave_vectors, axis=1)
    heights = np.sin(points @ wave_vectors.T + phases) - np.sin(phases)
    return np.asarray(points + (heights * amplitudes) @ direction)


def _unit_vectors(generator: np.random.Generator) -> Array:
    angles = generator.uniform(0.0, 2 * np.pi, size=WAVES)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _effort(shape: Array) -> Array:
    """Share of the writing time up to each point at constant pace: ∫ max(curvature, floor)^{1/3} ds, from 0 to 1."""
    d1 = np.gradient(shape, axis=0)
    d2 = np.gradient(d1, axis=0)
    speed = np.linalg.norm(d1, axis=1)
    curvature = np.abs(d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]) / speed**3
    density = np.hypot(curvature, CURVATURE_FLOOR) ** (1 / 3) * speed
    effort = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2)])
    return np.asarray(effort / effort[-1])


def _minimum_jerk(progress: Array) -> Array:
    """Position on a unit path at a share of the time, at rest with zero acceleration at both ends."""
    return np.asarray(10 * progress**3 - 15 * progress**4 + 6 * progress**5)
