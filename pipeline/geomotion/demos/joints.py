"""Demonstrations as paths of joint positions."""

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from geomotion.demos.demonstrations import Array, Demonstrations, Trajectory
from geomotion.errors import DatasetError
from geomotion.robot.panda import JointLimits

CHANNEL = "joints_rad"
WHOLE_TURN_TOLERANCE_RAD = 1.0  # how far a jump may be from a whole turn, because the arm moves meanwhile
ROUNDING_RAD = 1e-6  # single precision: how far beyond a limit a recording may lie

_log = logging.getLogger("geomotion")


def joint_paths(
    demonstrations: Demonstrations, arm_joint_names: Sequence[str], limits: JointLimits, points: int
) -> list[Array]:
    """All demonstrations with `points` joint positions each, even in time, in the order of the arm's joints [rad].

    Joints are found by their names, and others, such as those of fingers, left out; where a dataset does not name its
    joints, it must have as many as the arm, in the arm's order.

    Returns:
        Paths of shape (point, joint).

    Raises:
        DatasetError: If there are no joints, their names are not those of the arm, angles are in degrees, or one lies
            beyond its limit; names demonstration, row, joint, value and limit.
    """
    columns = _columns(demonstrations, arm_joint_names)
    demonstrations = without_whole_turns(demonstrations)
    recorded = [trajectory.channels[CHANNEL][:, columns] for trajectory in demonstrations.trajectories]
    _refuse_degrees(demonstrations, recorded, limits)
    _refuse_beyond_limits(demonstrations, recorded, arm_joint_names, limits)
    return [
        _even_in_time(joints_rad, trajectory.time_s, points)
        for joints_rad, trajectory in zip(recorded, demonstrations.trajectories, strict=True)
    ]


def without_whole_turns(demonstrations: Demonstrations) -> Demonstrations:
    """The same joint positions without jumps by 2π from one row to the next; a warning counts those mended.

    Only angles that all lie within one turn of zero can have been wrapped; others are left as they are.
    """
    if CHANNEL not in demonstrations.channel_names:
        return demonstrations
    turns = [_turns(trajectory.channels[CHANNEL]) for trajectory in demonstrations.trajectories]
    jumps = sum(int((np.diff(turn, axis=0) != 0).sum()) for turn in turns)
    if not jumps:
        return demonstrations
    _log.warning("%s: mended %d jumps of joints by a whole turn", demonstrations.name, jumps)
    mended = [_turned(*pair) for pair in zip(demonstrations.trajectories, turns, strict=True)]
    return demonstrations.with_step(mended, f"mended {jumps} jumps of joints by a whole turn")


def _turned(trajectory: Trajectory, turns: Array) -> Trajectory:
    joints_rad = trajectory.channels[CHANNEL] + 2 * np.pi * turns
    return replace(trajectory, channels={**trajectory.channels, CHANNEL: joints_rad})


def _turns(joints_rad: Array) -> Array:
    """Whole turns to add to each row so that no joint jumps by one, shape (time, joint)."""
    steps = np.diff(joints_rad, axis=0)
    is_jump = np.abs(np.abs(steps) - 2 * np.pi) < WHOLE_TURN_TOLERANCE_RAD
    is_jump &= np.abs(joints_rad).max(axis=0) <= 2 * np.pi + ROUNDING_RAD
    jumps = np.where(is_jump, -np.sign(steps), 0.0)
    return np.concatenate([np.zeros((1, joints_rad.shape[1])), np.cumsum(jumps, axis=0)])


def _columns(demonstrations: Demonstrations, arm_joint_names: Sequence[str]) -> list[int]:
    """Where each of the arm's joints is in the recorded channel."""
    arm = f"the arm has {', '.join(arm_joint_names)}"
    if CHANNEL not in demonstrations.channel_names:
        found = ", ".join(demonstrations.channel_names)
        raise DatasetError(demonstrations.name, f"holds {found}; joint space needs {CHANNEL}: {arm}")
    names, count = list(demonstrations.joint_names), demonstrations[0].channels[CHANNEL].shape[1]
    if not names:
        if count != len(arm_joint_names):
            raise DatasetError(demonstrations.name, f"has {count} joints without names; {arm}; name the columns so")
        return list(range(count))
    if missing := [name for name in arm_joint_names if name not in names]:
        raise DatasetError(
            demonstrations.name,
            f"lacks {', '.join(missing)}: it has joints {', '.join(names)}, {arm}; rename its joints or choose its arm",
        )
    return [names.index(name) for name in arm_joint_names]


def _refuse_degrees(demonstrations: Demonstrations, recorded: Sequence[Array], limits: JointLimits) -> None:
    """Angles of more than a turn that would all be within the limits if they were degrees."""
    values = np.concatenate(recorded)
    largest = float(np.abs(values).max())
    if largest > 2 * np.pi and _beyond(values, limits).any() and not _beyond(np.radians(values), limits).any():
        raise DatasetError(
            demonstrations.name,
            f"joint positions reach {largest:.4g}: beyond the limits as radians, within them as degrees; "
            "set dataset.angle_unit=deg",
        )


def _refuse_beyond_limits(
    demonstrations: Demonstrations, recorded: Sequence[Array], names: Sequence[str], limits: JointLimits
) -> None:
    for number, joints_rad in enumerate(recorded):
        rows, joints = np.nonzero(_beyond(joints_rad, limits))
        if not rows.size:
            continue
        row, joint = int(rows[0]), int(joints[0])
        value, lower, upper = joints_rad[row, joint], limits.lower_rad[joint], limits.upper_rad[joint]
        label = demonstrations[number].label
        place = f"demonstration {number}" + (f" ({label})" if label else "") + f", row {row}"
        raise DatasetError(
            demonstrations.name,
            f"{place}: {names[joint]} is {value:.4g} rad, beyond its limits of {lower:.4g} to {upper:.4g} rad",
        )


def _beyond(joints_rad: Array, limits: JointLimits) -> np.ndarray:
    return (joints_rad < limits.lower_rad - ROUNDING_RAD) | (joints_rad > limits.upper_rad + ROUNDING_RAD)


def _even_in_time(joints_rad: Array, time_s: Array, points: int) -> Array:
    times = np.linspace(time_s[0], time_s[-1], points)
    return np.stack([np.interp(times, time_s, axis) for axis in joints_rad.T], axis=1)
