"""Preprocessing as explicit steps in a fixed order; every step that changes something is recorded with the data.

Order: trim, clocks from zero, quaternions, directions and whole turns of joints, resample, smooth, align end points,
scale, velocities.
"""

import logging
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from geomotion.config import PreprocessConfig, VelocitySource
from geomotion.demos.demonstrations import UNIT_AXES, VELOCITY_OF, Array, Demonstrations, Trajectory
from geomotion.demos.joints import without_whole_turns
from geomotion.errors import InvalidSetting

QUATERNION = "orientation_wxyz"
DIRECTION = "direction_xyz"
LENGTHS = ("position_m", "velocity_m_per_s")
EVEN_STEPS_TOLERANCE = 1e-3  # relative
ROUNDING = 1e-12
SINGLE_PRECISION = 1e-6
SMOOTHING_ORDER = 3

_log = logging.getLogger("geomotion")


def preprocess(demonstrations: Demonstrations, config: PreprocessConfig) -> Demonstrations:
    """Apply the steps of `config`.

    Recorded velocities do not survive resampling and smoothing: they are then estimated from the new positions, and
    the recorded steps say so.

    Raises:
        InvalidSetting: If a step does not fit the recordings.
    """
    _check_recorded_velocities(demonstrations, config)
    demonstrations = _trim(demonstrations, config)
    demonstrations = _start_clocks_at_zero(demonstrations)
    demonstrations = _tidy_quaternions(demonstrations)
    demonstrations = _tidy_directions(demonstrations)
    demonstrations = without_whole_turns(demonstrations)
    demonstrations = _resample(demonstrations, config)
    demonstrations = _smooth(demonstrations, config)
    demonstrations = _align_ends(demonstrations, config)
    demonstrations = _scale(demonstrations, config)
    return _provide_velocities(demonstrations, config)


def estimate_velocity(time_s: Array, values: Array) -> Array:
    """Differentiate samples at any increasing times, to second order also at both ends, shape (time, axes) [1/s]."""
    gradient = np.gradient(values, time_s, axis=0, edge_order=2 if len(time_s) > 2 else 1)
    return np.asarray(gradient, dtype=np.float64)


def _trim(demonstrations: Demonstrations, config: PreprocessConfig) -> Demonstrations:
    first, last = config.trim_start_points, config.trim_end_points
    if not first and not last:
        return demonstrations
    shortest = min(len(trajectory) for trajectory in demonstrations.trajectories)
    if shortest - first - last < 2:
        key = "trim_start_points" if first >= last else "trim_end_points"
        expected = f"at least two points left of the shortest demonstration, which has {shortest}"
        raise InvalidSetting(f"dataset.preprocess.{key}", max(first, last), expected)

    def trim(trajectory: Trajectory) -> Trajectory:
        kept = slice(first, len(trajectory) - last)
        channels = {name: values[kept] for name, values in trajectory.channels.items()}
        return replace(trajectory, time_s=trajectory.time_s[kept], channels=channels)

    parts = [f"{count} points at the {end}" for count, end in ((first, "start"), (last, "end")) if count]
    return _map(demonstrations, trim, f"trimmed {' and '.join(parts)}")


def _start_clocks_at_zero(demonstrations: Demonstrations) -> Demonstrations:
    if all(trajectory.time_s[0] == 0 for trajectory in demonstrations.trajectories):
        return demonstrations
    return _map(
        demonstrations,
        lambda trajectory: replace(trajectory, time_s=trajectory.time_s - trajectory.time_s[0]),
        "shifted the time of every demonstration to start at 0 s",
    )


def _tidy_quaternions(demonstrations: Demonstrations) -> Demonstrations:
    """Give quaternions unit length, and choose between q and -q; say how many needed it.

    The sign is the one nearer to the previous sample, at the start the one nearer to the first demonstration.
    """
    if QUATERNION not in demonstrations.channel_names:
        return demonstrations
    reference = demonstrations[0].channels[QUATERNION][0]
    turns = [
        np.einsum("ti,ti->t", q, np.concatenate([reference[None], q[:-1]]))
        for q in (trajectory.channels[QUATERNION] for trajectory in demonstrations.trajectories)
    ]
    flips = sum(int((turn < 0).sum()) for turn in turns)
    odd_lengths, is_rounded = _odd_lengths(demonstrations, QUATERNION)
    if not flips and is_rounded:
        return demonstrations
    if flips or odd_lengths:
        message = "%s: mended %d quaternions that were not of unit length and %d flips of their sign"
        _log.warning(message, demonstrations.name, odd_lengths, flips)

    def tidy(trajectory: Trajectory, turn: Array) -> Trajectory:
        signs = np.cumprod(np.where(turn < 0, -1.0, 1.0))
        q = trajectory.channels[QUATERNION] * signs[:, None]
        return replace(trajectory, channels=_normalise({**trajectory.channels, QUATERNION: q}))

    tidied = [tidy(*pair) for pair in zip(demonstrations.trajectories, turns, strict=True)]
    return demonstrations.with_step(
        tidied, "normalised quaternions, with signs continuous and alike across demonstrations"
    )


def _tidy_directions(demonstrations: Demonstrations) -> Demonstrations:
    """Give directions unit length, and say how many needed it; unlike q and -q, d and -d are different."""
    if DIRECTION not in demonstrations.channel_names:
        return demonstrations
    odd_lengths, is_rounded = _odd_lengths(demonstrations, DIRECTION)
    if is_rounded:
        return demonstrations
    if odd_lengths:
        _log.warning("%s: mended %d directions that were not of unit length", demonstrations.name, odd_lengths)
    return _map(
        demonstrations,
        lambda trajectory: replace(trajectory, channels=_normalise(dict(trajectory.channels))),
        "normalised directions",
    )


def _odd_lengths(demonstrations: Demonstrations, channel: str) -> tuple[int, bool]:
    """How many samples are off unit length by more than single precision is, and whether all are within rounding."""
    samples = np.concatenate([trajectory.channels[channel] for trajectory in demonstrations.trajectories])
    off = np.abs(np.linalg.norm(samples, axis=1) - 1)
    return int((off > SINGLE_PRECISION).sum()), bool((off <= ROUNDING).all())


def _resample(demonstrations: Demonstrations, config: PreprocessConfig) -> Demonstrations:
    points = config.resample_points
    if points is None:
        return demonstrations
    from scipy.interpolate import CubicSpline

    def resample(trajectory: Trajectory) -> Trajectory:
        time_s = np.linspace(trajectory.time_s[0], trajectory.time_s[-1], points)
        recorded = _without_velocities(trajectory)
        channels = {name: CubicSpline(trajectory.time_s, values)(time_s) for name, values in recorded.items()}
        return replace(trajectory, time_s=time_s, channels=_normalise(channels))

    return _map(demonstrations, resample, f"resampled to {points} points, even in time (cubic spline)")


def _smooth(demonstrations: Demonstrations, config: PreprocessConfig) -> Demonstrations:
    if config.smooth_window_s == 0:
        return demonstrations
    from scipy.signal import savgol_filter

    def smooth(trajectory: Trajectory) -> Trajectory:
        points = _window_points(trajectory, config.smooth_window_s)
        recorded = _without_velocities(trajectory)
        channels = {name: savgol_filter(values, points, SMOOTHING_ORDER, axis=0) for name, values in recorded.items()}
        return replace(trajectory, channels=_normalise(channels))

    step = f"smoothed over {config.smooth_window_s:g} s (Savitzky-Golay, order {SMOOTHING_ORDER})"
    return _map(demonstrations, smooth, step)


def _window_points(trajectory: Trajectory, window_s: float) -> int:
    """Odd number of samples in the window.

    Raises:
        InvalidSetting: If times are uneven, or the window is not wider than the polynomial needs, or too wide.
    """
    key = "dataset.preprocess.smooth_window_s"
    steps = np.diff(trajectory.time_s)
    mean = float(steps.mean())
    if np.ptp(steps) > EVEN_STEPS_TOLERANCE * mean:
        expected = "0, or times that are even in every demonstration: set dataset.preprocess.resample_points="
        raise InvalidSetting(key, window_s, expected)
    points = 2 * round(window_s / mean / 2) + 1
    narrowest = SMOOTHING_ORDER + 2
    if not narrowest <= points <= len(trajectory):
        expected = f"0, or a window of {(narrowest - 1) * mean:.3g} s to {trajectory.duration_s:.3g} s"
        raise InvalidSetting(key, window_s, expected)
    return points


def _align_ends(demonstrations: Demonstrations, config: PreprocessConfig) -> Demonstrations:
    names = list(_velocity_channels(demonstrations))
    if not config.align_end or not names:
        return demonstrations
    ends: dict[tuple[float, ...], list[Array]] = {}
    for trajectory in demonstrations.trajectories:
        ends.setdefault(trajectory.condition, []).append(trajectory.state(names)[-1])
    widths = [demonstrations[0].channels[name].shape[1] for name in names]

    def align(trajectory: Trajectory) -> Trajectory:
        values = trajectory.state(names)
        mean_end = np.mean(ends[trajectory.condition], axis=0)
        shifted = np.split(values + (mean_end - values[-1]), np.cumsum(widths)[:-1], axis=1)
        return _with_channels(trajectory, dict(zip(names, shifted, strict=True)))

    of_condition = " of the same condition" if demonstrations.condition_names else ""
    step = f"shifted {', '.join(names)} of every demonstration to the mean end point{of_condition}"
    return _map(demonstrations, align, step)


def _scale(demonstrations: Demonstrations, config: PreprocessConfig) -> Demonstrations:
    names = [name for name in demonstrations.channel_names if name in LENGTHS]
    if config.scale == 1 or not names:
        return demonstrations

    def scale(trajectory: Trajectory) -> Trajectory:
        return _with_channels(trajectory, {name: config.scale * trajectory.channels[name] for name in names})

    return _map(demonstrations, scale, f"scaled lengths by {config.scale:g}")


def _velocity_channels(demonstrations: Demonstrations) -> dict[str, str]:
    return {name: VELOCITY_OF[name] for name in demonstrations.channel_names if name in VELOCITY_OF}


def _check_recorded_velocities(demonstrations: Demonstrations, config: PreprocessConfig) -> None:
    missing = set(_velocity_channels(demonstrations).values()) - set(demonstrations.channel_names)
    if config.velocity is VelocitySource.recorded and missing:
        expected = f"estimated, because {demonstrations.name} records no {', '.join(sorted(missing))}"
        raise InvalidSetting("dataset.preprocess.velocity", config.velocity.value, expected)


def _provide_velocities(demonstrations: Demonstrations, config: PreprocessConfig) -> Demonstrations:
    wanted = _velocity_channels(demonstrations)
    survived = set(wanted.values()) <= set(demonstrations.channel_names)
    if not wanted or (config.velocity is VelocitySource.recorded and survived):
        return demonstrations

    def estimate(trajectory: Trajectory) -> Trajectory:
        positions = {velocity: trajectory.channels[name] for name, velocity in wanted.items()}
        return _with_channels(
            trajectory, {name: estimate_velocity(trajectory.time_s, values) for name, values in positions.items()}
        )

    return _map(demonstrations, estimate, "estimated velocities by second-order differences")


def _map(demonstrations: Demonstrations, function: Callable[[Trajectory], Trajectory], step: str) -> Demonstrations:
    return demonstrations.with_step([function(trajectory) for trajectory in demonstrations.trajectories], step)


def _with_channels(trajectory: Trajectory, channels: dict[str, Array]) -> Trajectory:
    return replace(trajectory, channels={**trajectory.channels, **channels})


def _without_velocities(trajectory: Trajectory) -> dict[str, Array]:
    return {name: values for name, values in trajectory.channels.items() if name not in VELOCITY_OF.values()}


def _normalise(channels: dict[str, Array]) -> dict[str, Array]:
    """Bring interpolated or averaged quaternions and directions back to unit length."""
    units = {name: values for name, values in channels.items() if name in UNIT_AXES}
    return channels | {name: values / np.linalg.norm(values, axis=1, keepdims=True) for name, values in units.items()}
