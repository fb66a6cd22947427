"""Clusters of points, for the start of mixtures."""

import numpy as np
import torch
from scipy.cluster.vq import ClusterError, kmeans2

from geomotion.errors import InvalidSetting
from geomotion.types import Float, Int, Tensor

ROUNDS = 50


def nearest_centres(points: Float[Tensor, "point D"], count: int) -> Int[Tensor, " point"]:
    """k-means from well separated points: the number of the cluster of each point, none of them empty.

    Each next centre at the start is the point that is farthest from those before, the first one that of largest norm.

    Raises:
        InvalidSetting: If there are fewer different points than clusters.
    """
    if (different := len(np.unique(points.numpy(), axis=0))) < count:
        raise InvalidSetting("field.components", count, f"at most {different}, the number of different states shown")
    centres = points[points.norm(dim=-1).argmax()][None]
    for _ in range(count - 1):
        centres = torch.cat([centres, points[torch.cdist(points, centres).amin(-1).argmax()][None]])
    try:
        _, member = kmeans2(points.numpy(), centres.numpy(), ROUNDS, minit="matrix", missing="raise")
    except ClusterError:  # one ran empty on the way; none of the first ones is
        return torch.cdist(points, centres).argmin(-1)
    return torch.from_numpy(member).long()
