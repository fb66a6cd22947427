"""Poses made of two LASA shapes, one for the position and one for the orientation."""

import numpy as np

from geomotion.config import LasaPoseDataset
from geomotion.demos.demonstrations import Array, Demonstrations, Trajectory
from geomotion.demos.readers.lasa import LICENCE, SOURCE, read_shapes, stack

PROJECTION = (
    "orientations are points (y1, y2) of the second shape, projected from the centre of the sphere S3: "
    "q is (l, y1, y2, 0) divided by its length, with l = {distance_m:g} m, so that motions end without rotation"
)


def read(config: LasaPoseDataset) -> Demonstrations:
    """Poses [m], unit quaternions wxyz; demonstration i of both shapes on one clock, see :func:`lasa.stack`.

    Raises:
        MissingData: If a file is missing and cannot be downloaded.
        DatasetError: If a file cannot be read.

    Source:
        Thesis Sec. 6.4.5: two letters, one embedded in R³ "by concatenating with a zero", one projected "onto a
        3-sphere" in a way that it does not give.
    """
    names = (config.position_shape, config.orientation_shape)
    shapes = read_shapes(config.root, names)
    planar = stack([shapes[name] for name in names])
    return Demonstrations(
        name=config.name,
        trajectories=tuple(_pose(one, config.sphere_distance_m) for one in planar),
        space="R3xS3",
        frame="tablet, origin at the target",
        source=f"{SOURCE}; position {names[0]}, orientation {names[1]}",
        licence=LICENCE,
        steps=(PROJECTION.format(distance_m=config.sphere_distance_m),),
    )


def on_sphere(points: Array, distance_m: float) -> Array:
    """Points of a plane that touches S³ at the identity, seen from its centre, shape (time, 4)."""
    ahead, across = np.full((len(points), 1), distance_m), np.zeros((len(points), 1))
    quaternions = np.concatenate([ahead, points, across], axis=1)
    return np.asarray(quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True))


def _pose(planar: Trajectory, distance_m: float) -> Trajectory:
    position, velocity = planar.channels["position_m"], planar.channels["velocity_m_per_s"]
    flat = np.zeros((len(planar), 1))
    return Trajectory(
        planar.time_s,
        {
            "position_m": np.concatenate([position[:, :2], flat], axis=1),
            "velocity_m_per_s": np.concatenate([velocity[:, :2], flat], axis=1),
            "orientation_wxyz": on_sphere(position[:, 2:], distance_m),
        },
    )
