"""J-shaped positions in the plane with C-shaped directions on the sphere: the small example of geodesic skills.

Both are strokes of :mod:`geomotion.demos.generators.letters`, each repeated with its own human-like variation. The
plane of the C touches the sphere at its pole; rays through the centre carry the stroke over.

Source:
    Thesis Sec. 3.5.2, Fig. 3.1, 3.2.
"""

import numpy as np

from geomotion.config import JCDataset, LettersDataset
from geomotion.demos.demonstrations import Array, Demonstrations, Trajectory
from geomotion.demos.generators import letters
from geomotion.demos.generators.provenance import generated

C_HEIGHT = 1.5  # in radii of the sphere: about 75 degrees seen from its centre
C_MIDDLE = (-0.35 * C_HEIGHT, 0.35 * C_HEIGHT)  # of the stroke, seen from its end
WHAT = "J-shaped positions, C-shaped directions"


def generate(config: JCDataset) -> Demonstrations:
    """Write both letters at once: ``position_m`` [m] ends at the origin, ``direction_xyz`` is of unit length.

    The same configuration gives the same demonstrations; a demonstration does not depend on how many follow it.
    """
    other_seed = int(np.random.SeedSequence((config.seed, 1)).generate_state(1)[0])
    pairs = zip(_write("j", config.size_m, config.seed, config), _write("c", C_HEIGHT, other_seed, config), strict=True)
    return generated(
        config,
        (_join(j, c) for j, c in pairs),
        WHAT,
        space="R2xS2",
        frame="drawing plane, origin at the target; directions from the centre of the sphere, z to its pole",
    )


def _write(letter: str, height: float, seed: int, config: JCDataset) -> tuple[Trajectory, ...]:
    settings = LettersDataset(
        name=config.name,
        letter=letter,
        size_m=height,
        seed=seed,
        demos=config.demos,
        points=config.points,
        duration_s=config.duration_s,
        variation=config.variation,
    )
    return letters.generate(settings).trajectories


def _join(j: Trajectory, c: Trajectory) -> Trajectory:
    """The J with its own clock; of the C, the places at equal shares of its time."""
    channels = {"position_m": j.channels["position_m"], "direction_xyz": _project(c.channels["position_m"] - C_MIDDLE)}
    return Trajectory(j.time_s, channels)


def _project(plane: Array) -> Array:
    """Directions from the centre of the unit sphere to points of the plane that touches its pole, shape (point, 3)."""
    rays = np.column_stack([plane, np.ones(len(plane))])
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))
