"""A latent space with a closed form: two tubes along the first axis, each around a demonstration."""

import numpy as np

from geomotion.figures.latent import LatentMaps

AXIS = np.linspace(-1.5, 1.5, 25)
CENTRES = (-0.7, 0.7)  # of the tubes, along the second axis
RADIUS = 0.4  # where the walls are
WALL = 8.0


def maps(groups=(0, 1)):
    """Values rise from 0 in the middle of each tube to the wall, and fall to 0 again outside of it; tubes have ends."""
    x, y, z = np.meshgrid(AXIS, AXIS, AXIS, indexing="ij")
    beyond = (np.abs(x) - 1.0).clip(min=0)
    apart = np.min([np.sqrt((y - centre) ** 2 + z**2 + beyond**2) for centre in CENTRES], axis=0)
    height = WALL * np.exp(-(((apart - RADIUS) / 0.2) ** 2))
    codes = [
        np.stack([np.linspace(-1, 1, 30), np.full(30, centre), np.zeros(30)], axis=1)
        for centre, _ in zip(CENTRES, groups, strict=True)
    ]
    return LatentMaps((AXIS,) * 3, height - 2, height, apart < 0.5, codes, np.empty((0, 3)), list(groups))


def obstacle():
    """Nodes in a slab across both tubes, and far outside of them."""
    return np.broadcast_to((np.abs(AXIS) < 0.3)[:, None, None], (len(AXIS),) * 3).copy()
