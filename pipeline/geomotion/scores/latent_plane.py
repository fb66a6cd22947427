"""A plane of the latent space in which the motions of a skill of few dimensions are seen (Fig. 6.15)."""

import numpy as np
import torch
from jaxtyping import Float

from geomotion.scores.array_field import ArrayField
from geomotion.scores.evaluation import Evaluation
from geomotion.scores.grids import bounding_box, sample_box
from geomotion.scores.nearby import claimed_coordinates
from geomotion.scores.reproduction import Judged

POINTS_PER_AXIS, MARGIN = 30, 0.08


def latent_plane(field: ArrayField, one: Judged, starts: Float[np.ndarray, "start D"], skill_dim: int) -> Evaluation:
    """A demonstration, the motion from its start and those displaced to others, and the latent field, as arrays.

    The plane is that of the first two skill coordinates; of a skill of one dimension, the second coordinate is the
    direction beside the manifold in which the starts lie farthest apart. As all of these decay alike, the field in the
    plane is the field itself.

    Args:
        field: Its latent coordinates begin with those of the skill.
        one: The demonstration.
        starts: Where other motions are displaced to.
        skill_dim: d, coordinates of the skill.
    """
    exact = field.exact()
    begun = exact.begun(np.repeat(one.states[:1], 1 + len(starts), axis=0))
    rolled = begun.without_offsets(begun.roll(np.concatenate([one.states[:1], starts]), one.time_s), one.time_s)
    moved = claimed_coordinates(exact.to_claimed, rolled)
    basis = np.eye(moved.shape[-1])[:2]
    if skill_dim == 1:
        beside = moved[1:, 0, 1:] - moved[0, 0, 1:]
        basis[1, 1:] = np.linalg.svd(beside, full_matrices=False)[2][0]
    paths = moved @ basis.T
    demonstrated = exact.begun(one.states[:1]).without_offsets(one.states[None], one.time_s)[0]
    shown = exact.to_claimed(demonstrated) @ basis.T
    grid = sample_box(bounding_box([*paths, shown]).enlarged(MARGIN), POINTS_PER_AXIS, seed=0).points
    with torch.no_grad():
        velocity = exact.field.field(exact.tensor(grid @ basis)).numpy() @ basis.T
    arrays = {
        "latent_demonstrated": shown,
        "latent_paths": paths,
        "latent_points": grid,
        "latent_velocity": velocity,
        "latent_is_skill": np.array([True, skill_dim > 1]),
    }
    return Evaluation(arrays=arrays)
