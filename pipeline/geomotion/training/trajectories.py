"""Fitting whole trajectories of a field that is solvable in closed form: no solver, no unrolling."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from geomotion.config import TrajectoryTraining
from geomotion.dynamics.charts import AnchoredChart
from geomotion.dynamics.embedded import EmbeddedField
from geomotion.dynamics.fields import ChartedField, SolvableField
from geomotion.training.data import Geometry, Surroundings, TrainingSet, part_slices
from geomotion.training.trainer import Losses
from geomotion.types import Float, Int, Tensor

MIXING_PARTNERS = 2  # mixtures with any other one would be motions that nobody makes, where there are several ways
ROUNDING = 1e-6  # keeps the root of a squared distance differentiable at 0


@dataclass(frozen=True)
class Curves:
    """Trajectories with the same number of points; lengths in scaled units, times in mean durations."""

    times: Float[Tensor, "demo point"]
    states: Float[Tensor, "demo point D"]

    def at(self, index: Int[Tensor, "demo *index"]) -> tuple[Tensor, Tensor]:
        """Times and states of chosen points of each demonstration."""
        row = torch.arange(len(index)).view(-1, *(1,) * (index.ndim - 1))
        return self.times[row, index], self.states[row, index]


@dataclass(frozen=True)
class Samples:
    """Where trajectories begin, and where they should be later; scaled, times in mean durations.

    Attributes:
        starts: Points of demonstrations.
        begin: Times of `starts`.
        times: Later times; the last one is that of the demonstration's end.
        targets: Where the demonstrations are then.
    """

    starts: Float[Tensor, "demo start D"]
    begin: Float[Tensor, "demo start"]
    times: Float[Tensor, "demo start time"]
    targets: Float[Tensor, "demo start time D"]


class TrajectoryReproduction:
    """Distance between demonstrations and trajectories from their own states, at equal times and as curves.

    Each step draws starts on the demonstrations, the first of them their beginnings, and times after each. Half of the
    starts lie on mixtures of two similar demonstrations, x_i + λ (x_j - x_i), which stand for the repetitions that a
    person did not show, and a little beside them: without these the field learns the starts of the training set by
    heart. After a warm-up, the nearest-point term compares whole curves, which lets the shape count more than the
    timing. Beside the demonstrations, where nothing is known, haste is held against the field. Where the skill has
    fewer coordinates than the state, shown states have to be near what these coordinates say of them.

    Args:
        data: Demonstrations.
        geometry: Their size and duration.
        settings: Weights and sample sizes.
        parts: Coordinates of each part of a state, such as position and orientation: curves are compared by the nearest
            points of each part; None: of whole states.
    """

    def __init__(
        self, data: TrainingSet, geometry: Geometry, settings: TrajectoryTraining, parts: Sequence[int] | None = None
    ) -> None:
        self.settings = settings
        self.parts = part_slices(data.states[0].shape[1], parts)
        self.scale_m = geometry.scale_m
        self.duration_s = geometry.duration_s
        self.centre = torch.tensor(geometry.centre)
        self.curves = self._common_length(data)
        self.partners = nearest_curves(self.curves.states, MIXING_PARTNERS)
        self.curve_stride = min(settings.curve_stride, self.curves.times.shape[1] // 2)  # a curve has two points
        self.states = data.all_states
        self.times = torch.cat(data.times) / geometry.duration_s
        self.start_noise = torch.full((self.states.shape[1],), settings.start_noise)
        self.codes = max(1, geometry.context)  # shares of the chart's parameters, of which each motion has one
        self.start_noise[len(self.start_noise) - geometry.context :] = 0  # a condition is known exactly
        self.velocities = data.all_velocities
        self.surroundings = Surroundings(data, settings.surroundings, geometry.context)
        self.top_speed = self.velocities.norm(dim=-1).max()
        self.mean_square_speed = self.velocities.square().sum(-1).mean()

    def __call__(self, model: ChartedField, progress: float, generator: torch.Generator) -> Losses:
        settings = self.settings
        curve_term = progress >= settings.warm_up
        mixed = self._mix(generator)
        chosen = torch.randint(len(self.states), (settings.velocity_points,), generator=generator)
        samples = self._samples(mixed, generator)
        followed, first = self._followed(mixed, generator)
        curve_times = self._curve_times(followed, generator)

        # one pass through ψ for velocities, starts and goal, one through its inverse for all trajectories
        chart, field = model.chart, model.field
        assert isinstance(chart, AnchoredChart) and isinstance(field, SolvableField)
        known = self.states[chosen]
        if settings.haste_weight > 0:
            known = torch.cat([known, self.surroundings.draw(settings.haste_points, generator)])
        queried = torch.cat([known, self._to_metres(samples.starts).flatten(0, 1), chart.anchor[None]])
        z, push_forward = chart.chart.linearise(queried)
        image = z[-1]
        shown = len(chosen)
        laws = model.law_at(self._from_metres(self.states[chosen]))
        latent = field(z - image)
        paced = model.paced(latent[:shown], self.times[chosen][:, None], laws)
        velocities = push_forward(torch.cat([paced, latent[shown:]]))[: len(known)] / model.time_unit_s
        latent_starts = (z[len(known) : -1] - image).view(samples.starts.shape)
        # a condition is the same in scaled and in latent coordinates, up to where they begin
        paths = [model.flow(latent_starts, samples.times, model.law_at(samples.starts), samples.begin).flatten(0, 2)]
        if curve_term:
            law = model.law_at(followed.states[:, 0])
            begun = latent_starts[:, first]
            if isinstance(field, EmbeddedField) and model.start_memory is not None:
                begun = field.project(begun)  # undisturbed motions stay on the skill's manifold
            paths.append(model.flow(begun, curve_times, law).flatten(0, 1))
        count = sum(map(len, paths))
        if isinstance(field, EmbeddedField):
            paths.append(field.project(z[:shown] - image))
        x = self._from_metres(chart.chart.to_ambient(torch.cat(paths) + image))

        error = (velocities[:shown] - self.velocities[chosen]).square().sum(-1).mean() / self.mean_square_speed
        distance = (x[: len(paths[0])].view(samples.targets.shape) - samples.targets).square().sum(-1)
        equal_time = distance.mean()
        squares = [parameter.square().sum() for parameter in chart.parameters()]
        size = torch.stack(squares).sum() if squares else torch.zeros(())  # the identity has no parameters
        losses = {
            "velocity": settings.velocity_weight * error,
            "weights": settings.weight_penalty * size / self.codes,
            "end": settings.end_weight * distance[..., -1].mean(),
        }
        if len(x) > count:
            apart = x[count:] - self._from_metres(self.states[chosen])
            losses["projection"] = settings.projection_weight * apart.square().sum(-1).mean()
        if settings.haste_weight > 0:
            losses["haste"] = settings.haste_weight * self._haste(velocities[shown:])
        if not curve_term:
            return losses | {"equal_time": settings.equal_time_warm_up_weight * equal_time}
        curve = x[len(paths[0]) : count].view(*curve_times.shape, -1)
        phase = int(torch.randint(self.curve_stride, (), generator=generator))
        return losses | {
            "equal_time": settings.equal_time_weight * equal_time,
            "nearest_point": self._nearest_point(curve, followed.states[:, phase :: self.curve_stride]),
        }

    def _common_length(self, data: TrainingSet) -> Curves:
        """Demonstrations on as many points as the longest has, by linear interpolation between neighbours."""
        count = max(len(times) for times in data.times)
        times, states = [], []
        for own_times, own_states in zip(data.times, data.states, strict=True):
            position, own = np.linspace(0, len(own_times) - 1, count), np.arange(len(own_times))
            times.append(np.interp(position, own, own_times.numpy()))
            states.append(np.stack([np.interp(position, own, column) for column in own_states.T.numpy()], -1))
        scaled = self._from_metres(torch.tensor(np.stack(states), dtype=torch.float32))
        return Curves(torch.tensor(np.stack(times) / self.duration_s, dtype=torch.float32), scaled)

    def _from_metres(self, states: Tensor) -> Tensor:
        return (states - self.centre) / self.scale_m

    def _to_metres(self, states: Tensor) -> Tensor:
        return states * self.scale_m + self.centre

    def _haste(self, velocities: Tensor) -> Tensor:
        """How far speeds exceed the fastest demonstrated one; the logarithm keeps single wild states from ruling."""
        excess: Tensor = (velocities.norm(dim=-1) / self.top_speed - 1).relu()
        return excess.log1p().square().mean()

    def _mix(self, generator: torch.Generator) -> Curves:
        """Each demonstration moved towards, or away from, one that is like it."""
        curves = self.curves
        share = self.settings.mixing * (2 * torch.rand(len(curves.times), 1, generator=generator) - 1)
        choice = torch.randint(self.partners.shape[1], (len(curves.times),), generator=generator)
        other = self.partners[torch.arange(len(curves.times)), choice]
        return Curves(
            curves.times + share * (curves.times[other] - curves.times),
            curves.states + share[..., None] * (curves.states[other] - curves.states),
        )

    def _samples(self, mixed: Curves, generator: torch.Generator) -> Samples:
        demos, points, _ = self.curves.states.shape
        starts, half = self.settings.starts, self.settings.starts // 2
        begin = (torch.rand(demos, starts, generator=generator) * (points - 2)).long()
        begin[:, [0, half]] = 0
        share = torch.arange(self.settings.times) + torch.rand(demos, starts, self.settings.times, generator=generator)
        rest = (points - 1 - begin)[..., None]
        later = begin[..., None] + 1 + (share / self.settings.times * rest).long().clamp(max=points - 2)
        later = later.clamp(max=points - 1)
        later[..., -1] = points - 1
        parts = []
        for curves, part in ((self.curves, slice(0, half)), (mixed, slice(half, None))):
            start_times, start_states = curves.at(begin[:, part])
            parts.append((start_states, start_times, *curves.at(later[:, part])))
        samples = Samples(*(torch.cat(pair, 1) for pair in zip(*parts, strict=True)))
        beside = samples.starts[:, half:]
        beside += self.start_noise * torch.randn(beside.shape, generator=generator)
        return samples

    def _followed(self, mixed: Curves, generator: torch.Generator) -> tuple[Curves, int]:
        """Curves for the nearest-point term, and which start begins them: mixtures in every second step, on average."""
        if self.settings.mixing > 0 and float(torch.rand((), generator=generator)) < 0.5:
            return mixed, self.settings.starts // 2
        return self.curves, 0

    def _curve_times(self, curves: Curves, generator: torch.Generator) -> Float[Tensor, "demo time"]:
        demos, points = curves.times.shape
        inner = self.settings.curve_points - 1
        share = (torch.arange(inner) + torch.rand(demos, inner, generator=generator)) / inner
        index = (torch.cat([torch.zeros(demos, 1), share], 1) * (points - 1)).round().long()
        return curves.at(index)[0]

    def _nearest_point(self, curve: Float[Tensor, "demo k D"], demonstration: Float[Tensor, "demo m D"]) -> Tensor:
        losses = [self._nearest_point_of(curve[..., part], demonstration[..., part]) for part in self.parts]
        return torch.stack(losses).sum()

    def _nearest_point_of(self, curve: Float[Tensor, "demo k d"], demonstration: Float[Tensor, "demo m d"]) -> Tensor:
        with torch.no_grad():
            distance = torch.cdist(curve, demonstration)
            to_demonstration, to_curve = distance.argmin(2), distance.argmin(1)
        there = squared_distance_to_curve(curve, demonstration, to_demonstration)
        back = squared_distance_to_curve(demonstration, curve, to_curve)
        mean = (there + ROUNDING).sqrt().mean() + (back + ROUNDING).sqrt().mean()
        square = there.mean() + back.mean()
        return self.settings.nearest_point_weight * square + self.settings.nearest_point_mean_weight * mean


def nearest_curves(curves: Float[Tensor, "demo point D"], count: int) -> Int[Tensor, "demo partner"]:
    """For each curve the `count` others, or as many as there are, that are nearest point by point; itself if alone."""
    distance = (curves[:, None] - curves).norm(dim=-1).mean(-1)
    distance.fill_diagonal_(torch.inf)
    order: Tensor = distance.argsort(1)
    return order[:, : max(1, min(count, len(curves) - 1))]


def squared_distance_to_curve(
    points: Float[Tensor, "demo k D"], curve: Float[Tensor, "demo m D"], nearest: Int[Tensor, "demo k"]
) -> Float[Tensor, "demo k"]:
    """Squared distance to the two segments that meet at the nearest vertex of a polyline."""
    row = torch.arange(len(curve))[:, None]
    distances = []
    for offset in (-1, 0):
        begin = (nearest + offset).clamp(0, curve.shape[1] - 2)
        origin, end = curve[row, begin], curve[row, begin + 1]
        along = end - origin
        share = ((points - origin) * along).sum(-1) / along.square().sum(-1).clamp_min(1e-9)
        distances.append((origin + share.clamp(0, 1)[..., None] * along - points).square().sum(-1))
    return torch.minimum(*distances)
