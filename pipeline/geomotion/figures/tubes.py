"""Hollow tubes of a latent space: where geodesics stay, between walls of the magnification factor (Fig. 4.6, 4.7)."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import label, uniform_filter

from geomotion.figures.isosurface import Mesh, isosurface
from geomotion.figures.latent import LatentMaps

DATA_PERCENTILE, WALL_PERCENTILE = 95.0, 99.0
TOUCHING = np.ones((3, 3, 3), dtype=bool)  # diagonal neighbours, too: a surface could pass between them


@dataclass(frozen=True)
class Tubes:
    """The part of a latent space that encoded demonstrations share with all that no wall parts from them.

    Attributes:
        level: log √det M at which the walls are drawn.
        inside: Nodes below it, connected to a demonstration.
        wall: Their boundary; normals point out of the tubes.
    """

    level: float
    inside: Bool[np.ndarray, "nx ny nz"]
    wall: Mesh


def tubes_of(maps: LatentMaps) -> Tubes:
    """Cut the magnification factor of a latent space at the level of :func:`wall_level`.

    Outside the walls, far from all data, it is small again: the decoder does not change there. That part is left out.
    """
    level, values = wall_level(maps), maps.log_magnification
    parts, _ = label(values <= level, TOUCHING)
    corners, codes = maps.corners, np.concatenate(maps.codes)
    steps = np.rint((codes - corners[0]) / (corners[1] - corners[0]) * (np.array(values.shape) - 1)).astype(int)
    reached = np.setdiff1d(parts[tuple(steps.T)], 0)
    inside = np.isin(parts, reached)
    above = np.nextafter(level, np.inf)
    return Tubes(level, inside, isosurface(maps.axes, np.where(inside, values, np.maximum(values, above)), level))


def wall_level(maps: LatentMaps) -> float:
    """Halfway between data and walls.

    Halfway between what 95 % of the encoded demonstrations stay below and what 1 % of the nodes exceed.
    """
    at_nodes = RegularGridInterpolator(maps.axes, maps.log_magnification)
    data = np.percentile(at_nodes(np.concatenate(maps.codes)), DATA_PERCENTILE)
    return float((data + np.percentile(maps.log_magnification, WALL_PERCENTILE)) / 2)


def obstructed(maps: LatentMaps, tubes: Tubes, closed: Bool[np.ndarray, "nx ny nz"]) -> Mesh:
    """Surface of what obstacles take of the inside of tubes; normals point into it.

    Of nodes, it is only known whether they are taken: their mean over three nodes along each axis is cut at one half.
    """
    return isosurface(maps.axes, uniform_filter((closed & tubes.inside).astype(float), size=3), 0.5)
