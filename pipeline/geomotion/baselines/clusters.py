"""Clusters of points, for the start of mixtures."""

import torch

from geomotion.types import Float, Int, Tensor

ROUNDS = 50


def nearest_centres(points: Float[Tensor, "point D"], count: int) -> Int[Tensor, " point"]:
    """Lloyd's algorithm from well separated points: the number of the cluster of each point, none of them empty.

    Each next centre at the start is the point that is farthest from those before, the first one that of largest norm.
    There have to be as many different points as clusters.
    """
    centres = points[points.norm(dim=-1).argmax()][None]
    for _ in range(count - 1):
        centres = torch.cat([centres, points[torch.cdist(points, centres).amin(-1).argmax()][None]])
    member = torch.cdist(points, centres).argmin(-1)
    for _ in range(ROUNDS):
        centres = torch.stack([points[member == k].mean(0) for k in range(count)])
        moved = torch.cdist(points, centres).argmin(-1)
        if moved.bincount(minlength=count).min() == 0:
            break
        member = moved
    return member
