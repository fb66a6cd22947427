"""How far states lie beside the manifold of a skill with fewer coordinates than states have."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float

from geomotion.dynamics.embedded import EmbeddedField
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.injective import decoder_of
from geomotion.scores.evaluation import Evaluation
from geomotion.scores.reproduction import Judged
from geomotion.scores.score import Score, mean_score
from geomotion.types import State, States, Tensor

Points = Float[np.ndarray, "point D"]
Separation = Callable[[Points, Points], Mapping[str, tuple[str, Float[np.ndarray, " point"]]]]
"""Distances between two lists of states, by the name of what is compared, each with its unit."""


@dataclass(frozen=True)
class Beside:
    """Where states are beside the manifold.

    Attributes:
        offset: z_e, latent coordinates that vanish on the manifold.
        projection: The states on the manifold with the same skill coordinates [m].
    """

    offset: Float[Tensor, "point e"]
    projection: States


@torch.no_grad()
def beside_manifold(field: ChartedField, x: States) -> Beside | None:
    """Nothing for a skill of as many coordinates as its states."""
    if not field.is_onto:
        decoder = decoder_of(field)
        return Beside(decoder.split(x)[1], decoder.project(x))
    if isinstance(field.field, EmbeddedField):
        z: State = field.chart.to_latent(x)
        return Beside(z[..., field.field.skill_dim :], field.chart.to_ambient(field.field.project(z)))
    return None


def judge_off_manifold(field: ChartedField, judged: Sequence[Judged], separation: Separation) -> Evaluation:
    """Offsets ‖z_e‖ of all states and of starts, and the way from each to its projection.

    The offset of held-out starts is to be read beside that of training states: the manifold is known to no better.
    The way from a start to its projection is a jump for a skill that is followed on the manifold only.

    Args:
        field: An embedded or a decoded field; nothing is judged of others.
        judged: Demonstrations.
        separation: How states are compared.

    Source: Thesis Sec. 6.4.2.
    """
    dtype = next(field.parameters()).dtype
    scores: dict[str, Score] = {}
    for subset, is_trained in (("train", True), ("heldout", False)):
        members = [_without_offset(field, one) for one in judged if one.is_trained is is_trained]
        for where, parts in (("states", members), ("starts", [states[:1] for states in members])):
            states = np.concatenate(parts) if parts else np.empty((0, field.dim))
            found = beside_manifold(field, torch.as_tensor(states, dtype=dtype)) if len(states) else None
            if found is None:
                continue
            name = f"{subset}.manifold.{where}"
            offsets = found.offset.double().norm(dim=-1).numpy()
            scores[f"{name}_offset"] = mean_score(offsets, "1", f"‖z_e‖ of {where}, latent units")
            for what, (unit, distances) in separation(states, found.projection.double().numpy()).items():
                note = f"from {where} to their projections on the manifold"
                scores[f"{name}_{what}"] = mean_score(distances, unit, note)
    return Evaluation(scores)


def _without_offset(field: ChartedField, one: Judged) -> Float[np.ndarray, "time D"]:
    """Demonstrated states without what a remembered start carries along, which is not beside the skill."""
    if field.start_memory is None:
        return one.states
    dtype = next(field.parameters()).dtype
    carried = field.start_memory.carried(torch.as_tensor(one.states[0], dtype=dtype))
    return np.asarray(one.states - carried.along(torch.as_tensor(one.time_s, dtype=dtype)).double().numpy())
