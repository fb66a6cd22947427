"""The path of a skill of one dimension goes where most demonstrations do."""

import torch

from geomotion.training.data import Geometry, TrainingSet
from geomotion.training.nearest_path import nearest_path, path_nearest_to

SHARES = torch.linspace(0, 1, 120)
WHOLE = [slice(0, 2)]
END = torch.tensor([1.0, 0.0])


def arch(height: float, lag: float = 0.0) -> torch.Tensor:
    """From (-1, 0) to (1, 0), at rest at both ends."""
    share = (SHARES + lag * (torch.pi * SHARES).sin().square()).clamp(0, 1)
    along = share * share * (3 - 2 * share)
    return torch.stack([2 * along - 1, height * (torch.pi * along).sin()], dim=-1)


def distance(path: torch.Tensor, curves: torch.Tensor) -> float:
    apart = torch.cdist(path.expand(len(curves), -1, -1), curves)
    return float(apart.amin(1).mean() + apart.amin(2).mean())


def length(curve: torch.Tensor) -> float:
    return float(curve.diff(dim=0).norm(dim=-1).sum())


def test_the_path_of_curves_that_are_the_same_is_that_curve() -> None:
    path, curves = nearest_path(arch(0.5).expand(4, -1, -1), END, WHOLE), arch(0.5).expand(4, -1, -1)
    assert distance(path, curves) < 0.01
    assert float((path - arch(0.5)).norm(dim=-1).mean()) < 0.015


def test_the_path_is_a_median() -> None:
    curves = torch.stack([arch(height) for height in (0.4, 0.42, 0.44, 0.46, 1.2)])
    path = nearest_path(curves, END, WHOLE)
    top = float(path[:, 1].max())
    assert 0.38 < top < 0.5 < float(curves.mean(0)[:, 1].max())
    assert distance(path, curves) < distance(curves.mean(0), curves)


def test_demonstrations_of_other_timing_leave_the_shape_alone() -> None:
    """Their mean at equal times is flatter than each of them where they turn."""
    loops = torch.stack([arch(0.8, lag) for lag in (-0.2, -0.1, 0.0, 0.1, 0.2)])
    folded = torch.stack([loops[..., 1], loops[..., 1].square()], dim=-1)  # up and down again at other times
    path = nearest_path(folded, folded[0, -1], WHOLE)
    assert distance(path, folded) < 0.6 * distance(folded.mean(0), folded)


def test_it_leads_from_the_mean_start_to_the_goal_and_the_path_is_no_longer_than_curves_are() -> None:
    noise = 0.05 * torch.randn(6, 1, 2, generator=torch.Generator().manual_seed(0))
    curves = torch.stack([arch(height) for height in (0.3, 0.4, 0.5, 0.6, 0.7, 0.8)]) + noise * SHARES[:, None]
    path = nearest_path(curves, END, WHOLE)
    torch.testing.assert_close(path[[0, -1]], torch.stack([curves.mean(0)[0], END]))
    assert length(path) < 1.02 * sum(map(length, curves)) / len(curves)


def test_units_do_not_matter() -> None:
    times = SHARES * 3
    curves = [arch(height) for height in (0.3, 0.5, 0.6)]
    found = []
    for unit in (1.0, 0.01):
        states = tuple(unit * curve + 5 * unit for curve in curves)
        velocities = tuple(torch.gradient(one, spacing=(times,), dim=0)[0] for one in states)
        data = TrainingSet((times,) * 3, states, velocities)
        found.append(path_nearest_to(data, Geometry.of(data)) / unit)
    torch.testing.assert_close(*found, rtol=1e-3, atol=1e-3)


def test_what_counts_is_when_samples_were_taken() -> None:
    """However many of them there are of the start."""
    places = (SHARES.square() * 119).long()  # most of them early
    lines = [torch.stack([2 * SHARES - 1, height * torch.ones(120)], dim=-1) for height in (-0.1, 0.0, 0.1)]
    data = TrainingSet((SHARES[places],) * 3, tuple(one[places] for one in lines), tuple(one[places] for one in lines))
    path = path_nearest_to(data, Geometry.of(data))
    torch.testing.assert_close(path[60], torch.zeros(2), rtol=0, atol=0.05)


def test_a_path_does_not_wait_where_demonstrations_agree() -> None:
    """Of demonstrations that part, most of what is near to all is where they begin."""
    share = SHARES[:, None]
    ways = [torch.tensor([1.0, side]) for side in (-0.6, -0.3, 0.0, 0.3, 0.6)]
    curves = torch.stack([(share * share * (3 - 2 * share)) * way for way in ways])
    mean = curves.mean(0)
    path = nearest_path(curves, mean[-1], WHOLE)
    scatter = (curves - mean).norm(dim=-1).amax(0)
    assert float(((path - mean).norm(dim=-1) - scatter).max()) < 0.05
    assert float(path[60, 0]) > 0.15  # where the mean is at 0.5, and waiting would be at 0
