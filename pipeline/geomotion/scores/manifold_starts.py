"""How motions that start beside the manifold of a skill come to it (thesis Sec. 6.4.2, Fig. 6.10)."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float

from geomotion.dynamics.injective import decoder_of, transition
from geomotion.scores.array_field import ArrayField
from geomotion.scores.evaluation import Evaluation, Unit
from geomotion.scores.off_manifold import beside_manifold
from geomotion.scores.score import mean_score

TRANSITION = 0.1  # of the duration, which a decoded skill is given to get to its manifold
BACK = 0.1  # of the distance at the start, from which on a motion counts as back

Points = Float[np.ndarray, "point D"]
Times = Float[np.ndarray, " time"]
Motions = Float[np.ndarray, "start time D"]


@dataclass(frozen=True)
class _Led:
    """Motions onto a manifold.

    Attributes:
        states: At all times.
        transition_s: How long a transition phase lasts; 0 without one.
        uncorrected: The same motions without it.
    """

    states: Motions
    transition_s: float
    uncorrected: Motions


def judge_manifold_starts(field: ArrayField, starts: Points, times_s: Times, unit: Unit) -> Evaluation:
    """Follow a skill from starts beside its manifold.

    A decoded skill is led to its manifold in a transition phase before it is followed; without that, Algorithm 2 keeps
    the offset. An embedded one is followed as it is: z_e decays meanwhile. Of others nothing is judged.

    Args:
        field: What was learned; what it may remember of starts is left out.
        starts: Beside the manifold.
        times_s: Of the motion, from 0 [s].
        unit: What distances are shown in.
    """
    field = field.forgetful()
    if field.is_plan or beside_manifold(field.field, field.tensor(starts)) is None:
        return Evaluation()
    led = _decayed(field, starts, times_s) if field.field.is_onto else _after_transition(field, starts, times_s)
    away, uncorrected = _away(field, led.states), _away(field, led.uncorrected)
    note = f"{len(starts)} random starts around that of the first demonstration"
    scores = {
        "jump": mean_score(unit.per_state_unit * away[:, 0], unit.name, f"from starts to their projections; {note}"),
        "left": mean_score(unit.per_state_unit * away[:, -1], unit.name, f"to the manifold at the end; {note}"),
        "left_uncorrected": mean_score(
            unit.per_state_unit * uncorrected[:, -1], unit.name, f"the same without a transition phase; {note}"
        ),
        "back_after": mean_score(_back_after(away, times_s), "1", f"of the duration; {note}"),
        "peak_speed": mean_score(_peak_speed(field, led.states, times_s), "1", f"of that from projections; {note}"),
    }
    arrays = {
        "time_s": times_s,
        "states": led.states,
        "away": away,
        "uncorrected_away": uncorrected,
        "transition_s": np.array(led.transition_s),
    }
    return Evaluation(
        {f"off_manifold.{name}": score for name, score in scores.items()},
        {f"off_manifold_{name}": values for name, values in arrays.items()},
    )


def _decayed(field: ArrayField, starts: Points, times_s: Times) -> _Led:
    states = field.roll(starts, times_s)
    return _Led(states, 0.0, states)


def _after_transition(field: ArrayField, starts: Points, times_s: Times) -> _Led:
    decoder, transition_s = decoder_of(field.field), TRANSITION * float(times_s[-1])
    is_led = times_s < transition_s
    shares = field.tensor(times_s[is_led] / transition_s)
    on_the_way = [
        transition(decoder, start, shares, transition_s)[0].double().numpy() for start in field.tensor(starts)
    ]
    later = np.concatenate([[0.0], times_s[~is_led] - transition_s])
    followed = field.roll(_projected(field, starts), later)[:, 1:]
    uncorrected = field.on_its_way().roll(starts, times_s)
    return _Led(np.concatenate([np.stack(on_the_way), followed], axis=1), transition_s, uncorrected)


@torch.no_grad()
def _projected(field: ArrayField, states: Points) -> Points:
    found = beside_manifold(field.field, field.tensor(states))
    assert found is not None
    return np.asarray(found.projection.double().numpy())


def _away(field: ArrayField, states: Motions) -> Float[np.ndarray, "start time"]:
    """Distances to projections on the manifold, in units of the state."""
    flat = states.reshape(-1, states.shape[-1])
    away = np.linalg.norm(flat - _projected(field, flat), axis=1)
    return np.asarray(away.reshape(states.shape[:2]))


def _back_after(away: Float[np.ndarray, "start time"], times_s: Times) -> Float[np.ndarray, " start"]:
    """Share of the duration until motions stay near; 1 where they do not."""
    is_far = away > BACK * away[:, :1]
    since = np.where(is_far.any(axis=1), is_far.shape[1] - is_far[:, ::-1].argmax(axis=1), 0)
    return np.asarray(times_s[since.clip(max=len(times_s) - 1)] / times_s[-1])


def _peak_speed(field: ArrayField, states: Motions, times_s: Times) -> Float[np.ndarray, " start"]:
    nominal = field.roll(_projected(field, states[:, 0]), times_s)
    speeds = [np.linalg.norm(np.diff(one, axis=1), axis=2) / np.diff(times_s) for one in (states, nominal)]
    return np.asarray(speeds[0].max(axis=1) / speeds[1].max(axis=1))
