"""Conditions as coordinates between those that were demonstrated."""

import numpy as np
import scipy.linalg
from jaxtyping import Float

from geomotion.errors import DatasetError

NEGLIGIBLE = 1e-6  # share of the largest variation of conditions below which a direction does not count


def barycentric_coordinates(
    conditions: Float[np.ndarray, "point K"],
) -> tuple[Float[np.ndarray, " R"], Float[np.ndarray, "K R"]]:
    """Coordinates offset + c @ directions between R of these points that lie far apart; they add up to one.

    R - 1 is the number of directions in which the points differ; of labels, R is their number.

    Raises:
        DatasetError: If they do not differ.
    """
    mean, spread = conditions.mean(0), conditions.std(0)
    if not (spread > 0).any():
        raise DatasetError("conditions", f"all demonstrations have {conditions[0].tolist()}; expected different ones")
    unit = np.divide(1.0, spread, out=np.zeros_like(spread), where=spread > 0)
    _, sizes, axes = np.linalg.svd((conditions - mean) * unit, full_matrices=False)
    reduced = unit[:, None] * axes[sizes > NEGLIGIBLE * sizes[0]].T
    homogeneous = np.concatenate([np.ones((len(conditions), 1)), (conditions - mean) @ reduced], 1)
    *_, order = scipy.linalg.qr(homogeneous.T, mode="economic", pivoting=True)
    corners = np.sort(order[: homogeneous.shape[1]])
    to_code = np.linalg.inv(homogeneous[corners])
    directions = reduced @ to_code[1:]
    return to_code[0] - mean @ directions, directions
