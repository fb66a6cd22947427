"""The path that a skill of one dimension is: the one that is nearest to all demonstrations."""

from collections.abc import Sequence

import numpy as np
import torch

from geomotion.manifolds.spline import even_basis
from geomotion.training.data import Geometry, TrainingSet, part_slices
from geomotion.types import Float, States, Tensor

POINTS = 121  # at which paths are compared
FINE, COARSE = 32, 12  # control points: of the mean of the demonstrations, and of how the path departs from it
STEPS = 400
LEARNING_RATE = 0.015  # in sizes of the demonstrations
SYNCHRONY = 0.07  # weight of distances at equal times: a path must not wait where demonstrations agree
SMALL = 5e-3  # distances below it count less and less, or paths would be caught by the points of a curve
OUTSIDE = 3.0  # of what leaves the band of the demonstrations
EXCESS = 0.2  # of what is longer than a demonstration: nor must it visit the end of each of them


def nearest_path(
    curves: Float[Tensor, "demo point D"], goal: Float[Tensor, " D"], parts: Sequence[slice]
) -> Float[Tensor, "point D"]:
    r"""A path from the mean start to the goal, with the least mean distance to curves.

    .. math::
        \sum_p \left( \operatorname{mean}_i d_p(m, x_i) + 3 \operatorname{mean}_t (\|m - \bar x\|_p - \sigma_p)_+
        + \tfrac{1}{5} (\ell_p(m) - \bar\ell_p)_+ \right)
        + \tfrac{7}{100} \operatorname{mean}_{i, t} \|m - x_i\|

    d_p is the mean distance of the points of each curve to the nearest of the other, of the part p of the coordinates;
    σ_p is how far the farthest curve is from their mean x̄ at each time, and ℓ_p the length. Distances and not their
    squares: the path goes where most demonstrations do, as a median, and at no time where they are not.

    Args:
        curves: At equal shares of their durations, in units of their size.
        goal: Where they end, but for a part of where they began.
        parts: Coordinates that are compared apart, such as position and orientation.
    """
    curves = curves.double()
    mean = curves.mean(0)
    fine, coarse = (torch.from_numpy(even_basis(count, len(mean))) for count in (FINE, COARSE))
    smooth = fine @ torch.linalg.lstsq(fine, mean).solution
    share = torch.linspace(0, 1, len(mean), dtype=torch.float64)[:, None]
    smooth = smooth + torch.lerp(mean[0] - smooth[0], goal.double() - smooth[-1], share)
    lengths = [_length(curves[..., part]).mean() for part in parts]
    bands = [(curves[..., part] - mean[:, part]).norm(dim=-1).amax(0) for part in parts]
    departure = torch.zeros(COARSE - 2, mean.shape[1], dtype=torch.float64, requires_grad=True)
    optimiser = torch.optim.Adam([departure], LEARNING_RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, STEPS)
    for _ in range(STEPS):
        path = smooth + coarse[:, 1:-1] @ departure
        loss = SYNCHRONY * _rounded((curves - path).norm(dim=-1)).mean()
        for part, length, band in zip(parts, lengths, bands, strict=True):
            outside = ((path - mean)[:, part].norm(dim=-1) - band).relu()
            loss = loss + OUTSIDE * outside.mean()
            loss = loss + _distance(path[:, part], curves[..., part])
            loss = loss + EXCESS * (_length(path[:, part]) - length).relu()
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        schedule.step()
    found: Tensor = (smooth + coarse[:, 1:-1] @ departure).detach().float()
    return found


def path_nearest_to(data: TrainingSet, geometry: Geometry, parts: Sequence[int] | None = None) -> States:
    """The path nearest to demonstrations, at equal times over their mean duration [m].

    Args:
        data: Demonstrations, which begin alike.
        geometry: Their size and goal.
        parts: How many coordinates each part of a state has; None: they are one part.
    """
    slices = part_slices(data.states[0].shape[1], parts)
    shown = zip(data.times, data.states, strict=True)
    curves = torch.stack([_resampled(times, states) for times, states in shown]) / geometry.scale_m
    goal = torch.tensor(geometry.goal) / geometry.scale_m
    path: States = geometry.scale_m * nearest_path(curves, goal, slices)
    return path


def _resampled(times: Float[Tensor, " shown"], states: Float[Tensor, "shown D"]) -> Float[Tensor, "point D"]:
    even = np.linspace(0, float(times[-1]), POINTS)
    return torch.from_numpy(np.stack([np.interp(even, times.numpy(), column) for column in states.T.numpy()], axis=-1))


def _distance(path: Float[Tensor, "point d"], curves: Float[Tensor, "demo point d"]) -> Float[Tensor, ""]:
    apart = torch.cdist(path.expand(len(curves), -1, -1), curves)
    return _rounded(apart.amin(1)).mean() + _rounded(apart.amin(2)).mean()


def _rounded(distance: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    return (distance.square() + SMALL**2).sqrt()


def _length(curve: Float[Tensor, "*batch point d"]) -> Float[Tensor, "*batch"]:
    lengths: Tensor = curve.diff(dim=-2).norm(dim=-1).sum(-1)
    return lengths
