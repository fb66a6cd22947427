"""Demonstrations as paths of poses."""

import numpy as np

from geomotion.demos.demonstrations import UNIT_AXES, Array, Demonstrations, Trajectory
from geomotion.errors import DatasetError
from geomotion.scores.paths import PosePath, of_one_sign


def orientation_channel(demonstrations: Demonstrations) -> str:
    """Name of the channel that holds unit quaternions or directions.

    Raises:
        DatasetError: If positions or orientations are missing, or there are both kinds of orientation.
    """
    found = [name for name in UNIT_AXES if name in demonstrations.channel_names]
    if "position_m" not in demonstrations.channel_names or len(found) != 1:
        raise DatasetError(
            demonstrations.name,
            f"holds {', '.join(demonstrations.channel_names)}; a manifold of poses needs position_m and either "
            f"{' or '.join(UNIT_AXES)}",
        )
    return found[0]


def pose_path(trajectory: Trajectory, channel: str) -> PosePath:
    """Poses of one demonstration; quaternions have one sign along the path."""
    orientation = trajectory.channels[channel]
    if channel == "orientation_wxyz":
        orientation = of_one_sign(orientation)
    return PosePath(trajectory.channels["position_m"], orientation)


def pose_paths(demonstrations: Demonstrations, points: int) -> list[PosePath]:
    """All demonstrations with `points` poses each, even in time."""
    channel = orientation_channel(demonstrations)
    return [_even_in_time(pose_path(one, channel), one.time_s, points) for one in demonstrations.trajectories]


def _even_in_time(path: PosePath, time_s: Array, points: int) -> PosePath:
    times = np.linspace(time_s[0], time_s[-1], points)
    position_m, orientation = (
        np.stack([np.interp(times, time_s, axis) for axis in values.T], axis=1)
        for values in (path.position_m, path.orientation)
    )
    return PosePath(position_m, orientation / np.linalg.norm(orientation, axis=1, keepdims=True))
