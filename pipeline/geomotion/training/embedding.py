"""From features of pictures to conditions: which demonstrated place it is, or where between them.

One layer gives scores of the places, and of "elsewhere" where there are pictures of it, and coordinates between the
places. The embedding is the mean of the corners (1, 0, 0), … and of those coordinates, weighted by the probabilities of
the scores: at the demonstrated places it is the class of the picture, elsewhere it is measured. Its entries add up to
one.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from torch import nn

from geomotion.config import EncoderConfig
from geomotion.demos.snapshots import BETWEEN
from geomotion.training.data import TrainingSet
from geomotion.types import Float, Int, State, Tensor, Trajectories

TRAJECTORY_TIMES = 16


@runtime_checkable
class TrajectoriesUnderConditions(Protocol):
    """A conditional field whose trajectories are known in closed form."""

    def trajectories(
        self, start: State, condition: Float[Tensor, "*batch K"], times: Float[Tensor, "*#batch time"]
    ) -> Trajectories:
        """States at times since the start [s]."""
        ...


class Embedding(nn.Module):
    """Features to the condition.

    Args:
        features: Numbers of each picture.
        places: K, of demonstrated places.
        knows_elsewhere: Whether pictures of other places are told apart from these.
    """

    mean: Tensor
    std: Tensor

    def __init__(self, features: int, places: int, knows_elsewhere: bool) -> None:
        super().__init__()
        self.places, self.knows_elsewhere = places, knows_elsewhere
        self.layer = nn.Linear(features, places + (1 + places if knows_elsewhere else 0))
        self.register_buffer("mean", torch.zeros(features))
        self.register_buffer("std", torch.ones(features))

    def forward(self, features: Float[Tensor, "*batch feature"]) -> Float[Tensor, "*batch K"]:
        """Entries add up to one."""
        outputs: Tensor = self.layer(self.normal(features))
        return embedded(outputs, self.places)

    def scores(self, features: Float[Tensor, "*batch feature"]) -> Float[Tensor, "*batch score"]:
        """Logits of the places, and of elsewhere where it is known."""
        scores: Tensor = self.layer(self.normal(features))[..., : self.places + self.knows_elsewhere]
        return scores

    def normal(self, features: Float[Tensor, "*batch feature"]) -> Float[Tensor, "*batch feature"]:
        """Features of mean 0 and equal variances over training pictures, which add up to one."""
        scaled: Tensor = (features - self.mean) / (self.std * features.shape[-1] ** 0.5)
        return scaled


def embedded(outputs: Float[Tensor, "*batch output"], places: int) -> Float[Tensor, "*batch K"]:
    """The embedding for the outputs of the layer."""
    if outputs.shape[-1] == places:
        return outputs.softmax(-1)
    share = outputs[..., : places + 1].softmax(-1)
    return share[..., :places] + share[..., places:] * _between(outputs, places)


def _between(outputs: Float[Tensor, "*batch output"], places: int) -> Float[Tensor, "*batch K"]:
    free = outputs[..., places + 1 :]
    return free + (1 - free.sum(-1, keepdim=True)) / places


@dataclass(frozen=True)
class Seen:
    """What is known of training pictures.

    Attributes:
        features: Of the encoder.
        place: Number of the place that was meant; -1 anywhere between.
        coordinates: Of the object between the places: barycentric ones.
    """

    features: Float[Tensor, "picture feature"]
    place: Int[Tensor, " picture"]
    coordinates: Float[Tensor, "picture K"]


@dataclass(frozen=True)
class Shown:
    """Demonstrations and the field that was fitted to them.

    Attributes:
        field: Frozen.
        data: Demonstrations.
        place: Number of the place of each.
        scale_m: Size of the motions.
    """

    field: TrajectoriesUnderConditions
    data: TrainingSet
    place: Int[np.ndarray, " demo"]
    scale_m: float


def barycentric(
    point_m: Float[np.ndarray, "point 2"], places_m: Float[np.ndarray, "3 2"]
) -> Float[np.ndarray, "point 3"]:
    """Coordinates of points between three places, which add up to one."""
    corners = np.concatenate([places_m, np.ones((3, 1))], axis=1)
    points = np.concatenate([point_m, np.ones((len(point_m), 1))], axis=1)
    return np.asarray(np.linalg.solve(corners.T, points.T).T)


def fit_embedding(seen: Seen, shown: Shown, settings: EncoderConfig) -> tuple[Embedding, Mapping[str, float]]:
    """Minimise cross-entropy, trajectory and place losses, and the squared weights, through a frozen field.

    The layer is found in the directions that the training pictures span, which is exact and small.

    Returns:
        The layer, and its losses at the end.
    """
    places = seen.coordinates.shape[1]
    is_between = seen.place == BETWEEN
    model = Embedding(seen.features.shape[1], places, bool(is_between.any()))
    model.mean.copy_(seen.features.mean(0))
    model.std.copy_(seen.features.std(0).clamp_min(1e-9))
    normal = model.normal(seen.features).double()
    _, _, directions = torch.linalg.svd(normal, full_matrices=False)
    reduced = normal @ directions.T
    weight = torch.zeros(len(directions), model.layer.out_features, dtype=torch.float64, requires_grad=True)
    bias = torch.zeros(model.layer.out_features, dtype=torch.float64, requires_grad=True)
    pairs = _pairs(seen, shown, settings.seed) if settings.trajectory_weight > 0 else None
    label = torch.where(is_between, places, seen.place)

    def losses() -> dict[str, Tensor]:
        outputs = reduced @ weight + bias
        condition = embedded(outputs, places)
        classes = outputs[:, : places + model.knows_elsewhere]
        found = {
            "class": settings.class_weight * nn.functional.cross_entropy(classes, label),
            "weights": settings.weight_penalty * weight.square().sum(),
        }
        if pairs is not None:
            found["trajectory"] = settings.trajectory_weight * _trajectory_error(condition, shown, pairs)
        if model.knows_elsewhere:
            measured = torch.stack([condition, _between(outputs, places)])
            square = (measured - seen.coordinates.double()).square().sum(-1)
            found["place"] = settings.place_weight * square.sum(0).mean()
        return found

    optimiser = torch.optim.LBFGS([weight, bias], max_iter=settings.steps, line_search_fn="strong_wolfe")

    def closure() -> float:
        optimiser.zero_grad()
        total = torch.stack(list(losses().values())).sum()
        total.backward()  # type: ignore[no-untyped-call]
        return float(total.detach())

    optimiser.step(closure)  # type: ignore[no-untyped-call]
    with torch.no_grad():
        model.layer.weight.copy_((directions.T @ weight).T)
        model.layer.bias.copy_(bias)
        return model, {name: float(value) for name, value in losses().items()}


@dataclass(frozen=True)
class _Pairs:
    """Pictures of demonstrated places, each with a demonstration of the same place."""

    picture: Int[Tensor, " pair"]
    start: Float[Tensor, "pair D"]
    times: Float[Tensor, "pair time"]
    states: Float[Tensor, "pair time D"]


def _pairs(seen: Seen, shown: Shown, seed: int) -> _Pairs:
    generator = np.random.default_rng(seed)
    pictures = np.flatnonzero(seen.place.numpy() != BETWEEN)
    demos = [int(generator.choice(np.flatnonzero(shown.place == int(seen.place[one])))) for one in pictures]
    data = shown.data
    rows = [torch.linspace(0, len(data.times[demo]) - 1, TRAJECTORY_TIMES).round().long() for demo in demos]
    return _Pairs(
        torch.from_numpy(pictures),
        torch.stack([data.states[demo][0] for demo in demos]),
        torch.stack([data.times[demo][row] for demo, row in zip(demos, rows, strict=True)]),
        torch.stack([data.states[demo][row] for demo, row in zip(demos, rows, strict=True)]),
    )


def _trajectory_error(condition: Float[Tensor, "picture K"], shown: Shown, pairs: _Pairs) -> Tensor:
    """Mean squared distance at equal times, in sizes of the motions."""
    found = shown.field.trajectories(pairs.start, condition[pairs.picture].float(), pairs.times)
    error: Tensor = ((found - pairs.states) / shown.scale_m).square().sum(-1).mean()
    return error.double()
