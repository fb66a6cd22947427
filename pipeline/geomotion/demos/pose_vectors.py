"""Poses of demonstrations as vectors that a field can be learned on."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import torch

from geomotion.demos.demonstrations import VELOCITY_OF, Array, Demonstrations, Trajectory
from geomotion.demos.preprocessing import estimate_velocity
from geomotion.errors import DatasetError
from geomotion.lie.cover import FIRST_COVER
from geomotion.lie.poses import POSE_DIM, CoverName, Group, PoseCoordinates
from geomotion.lie.rotations import mean_quaternion
from geomotion.scores.paths import of_one_sign

POSE_CHANNEL = "pose_m"
BODY_STATES: Mapping[tuple[str, ...], int] = {(POSE_CHANNEL,): POSE_DIM, ("position_m",): 3}  # of a body in space
COVERED = 0.97  # of the first cover's radius; farther out, Log is about to jump and coordinates stretch without bound
NEEDED = ("position_m", "orientation_wxyz")


def fit_pose_coordinates(
    demonstrations: Demonstrations, group: Group, cover: CoverName, lever_m: float | None
) -> PoseCoordinates:
    """Coordinates around the mean orientation of demonstrations.

    Args:
        demonstrations: Those to be learned.
        group: Whether q and -q are one orientation.
        cover: How the edge of the first cover is removed.
        lever_m: Length that counts as much as a radian [m]; None: as positions and orientations extend equally far.

    Raises:
        DatasetError: If positions or orientations are missing, or these spread over more than coordinates cover.
    """
    _require_poses(demonstrations)
    positions = np.concatenate([one.channels["position_m"] for one in demonstrations.trajectories])
    orientations = [of_one_sign(one.channels["orientation_wxyz"]) for one in demonstrations.trajectories]
    reference = mean_quaternion(torch.tensor(np.concatenate(orientations)))
    unscaled = PoseCoordinates(reference, 1.0, group, cover)
    turned = np.concatenate([_vectors(unscaled, one, demonstrations.name) for one in demonstrations.trajectories])
    extent_m, extent_rad = (np.ptp(values, axis=0).max() for values in (positions, turned[:, 3:]))
    if lever_m is None:
        lever_m = float(extent_m / extent_rad) if extent_m > 0 and extent_rad > 1e-3 else 0.1
    return PoseCoordinates(reference, lever_m, group, cover)


def with_pose_vectors(demonstrations: Demonstrations, coordinates: PoseCoordinates | None) -> Demonstrations:
    """Demonstrations with their poses as one more channel, :data:`POSE_CHANNEL`, and its velocities.

    Args:
        demonstrations: With positions and orientations.
        coordinates: Vectors of poses; None where the state is not a pose, and nothing is added.

    Raises:
        DatasetError: If positions or orientations are missing, or are not covered.
    """
    if coordinates is None:
        return demonstrations
    _require_poses(demonstrations)
    return replace(
        demonstrations,
        trajectories=tuple(_with_vectors(one, coordinates, demonstrations.name) for one in demonstrations.trajectories),
        space=f"R3x{coordinates.group}",
    )


def _require_poses(demonstrations: Demonstrations) -> None:
    missing = [name for name in NEEDED if name not in demonstrations.channel_names]
    if missing:
        found = ", ".join(demonstrations.channel_names)
        raise DatasetError(demonstrations.name, f"holds {found}; poses need {' and '.join(missing)} as well")
    if demonstrations.trajectories[0].channels["position_m"].shape[1] != 3:
        raise DatasetError(demonstrations.name, "holds positions in a plane; poses need three coordinates")


def _with_vectors(trajectory: Trajectory, coordinates: PoseCoordinates, name: str) -> Trajectory:
    vectors = _vectors(coordinates, trajectory, name)
    velocities = estimate_velocity(trajectory.time_s, vectors)
    recorded = trajectory.channels.get(VELOCITY_OF["position_m"])
    if recorded is not None:
        velocities[:, :3] = recorded
    added = {POSE_CHANNEL: vectors, VELOCITY_OF[POSE_CHANNEL]: velocities}
    return replace(trajectory, channels={**trajectory.channels, **added})


def _vectors(coordinates: PoseCoordinates, trajectory: Trajectory, name: str) -> Array:
    orientation = of_one_sign(trajectory.channels["orientation_wxyz"])
    reference = coordinates.reference.double()
    if coordinates.group == "S3" and float(orientation[0] @ reference.numpy()) < 0:
        orientation = -orientation
    wanted = torch.tensor(np.ascontiguousarray(orientation))
    exact = PoseCoordinates(reference, coordinates.lever_m, coordinates.group, coordinates.cover_name)
    turns = exact.turned_from_reference(wanted)
    farthest, radius = float(turns.norm(dim=-1).max()), FIRST_COVER[coordinates.group]
    if farthest > COVERED * radius:
        way_out = "; with space=R3xS3 it is twice as much" if coordinates.group == "SO3" else ""
        raise DatasetError(
            name,
            f"demonstration {trajectory.label or ''} turns {np.degrees(farthest):.0f} degrees away from the mean "
            f"orientation; coordinates cover {np.degrees(COVERED * radius):.0f}{way_out}",
        )
    vectors = exact.to_vector(torch.tensor(np.ascontiguousarray(trajectory.channels["position_m"])), wanted)
    return np.asarray(vectors.numpy())
