"""Where a field comes to rest, beside where it should."""

from copy import deepcopy

import numpy as np
import torch
from jaxtyping import Float
from scipy.optimize import root

from geomotion.dynamics.fields import ChartedField
from geomotion.scores.evaluation import Evaluation, Unit
from geomotion.scores.jacobians import field_jacobian
from geomotion.scores.score import mean_score

State = Float[np.ndarray, " D"]
AT_REST = 1e-9  # speed of an equilibrium, in sizes of the demonstrations per duration


def judge_equilibrium(field: ChartedField, goal: State, end: State, scale_m: float, unit: Unit) -> Evaluation:
    """How far from its goal, and from where the demonstrations end, a field comes to rest.

    Args:
        field: The field; it is judged in double precision, at mean speed.
        goal: x*, where its motions should end [m].
        end: Mean of where its demonstrations end [m].
        scale_m: Size of the demonstrations [m].
        unit: Unit in which distances are reported.

    Source:
        Thesis Eq. (5.13): the equilibrium moves with the condition.
    """
    exact = deepcopy(field).double().eval()
    speed = float(np.linalg.norm(_velocity(exact, goal)))
    scores = {
        "equilibrium.speed_at_goal": mean_score(
            [unit.per_state_unit * speed],
            f"{unit.name}/s",
            "|f(x*)|, at mean speed; 0 where the goal is an equilibrium",
        )
    }
    found = find_equilibrium(exact, goal, scale_m)
    if found is None:
        return Evaluation(scores, omitted={"equilibrium": "no state at rest was found from the goal by Newton steps"})
    for name, place, meaning in (("goal", goal, "the goal x*"), ("end", end, "the demonstrations' mean end")):
        distance = unit.per_state_unit * float(np.linalg.norm(found - place))
        note = f"between the equilibrium of the field and {meaning}"
        scores[f"equilibrium.{name}_distance"] = mean_score([distance], unit.name, note)
    return Evaluation(scores)


def find_equilibrium(field: ChartedField, near: State, scale_m: float) -> State | None:
    """The state with f(x) = 0 that damped Newton steps (Powell's hybrid method) lead to; None if they lead nowhere.

    Args:
        field: In double precision.
        near: Where to begin [m].
        scale_m: Size of the demonstrations [m].
    """
    unit_speed = scale_m / field.time_unit_s

    def velocity(offset: State) -> State:
        return _velocity(field, near + scale_m * offset) / unit_speed

    def jacobian(offset: State) -> Float[np.ndarray, "D D"]:
        state = torch.as_tensor(near + scale_m * offset)[None]
        return field.time_unit_s * field_jacobian(field, state)[0].numpy()

    found = root(velocity, np.zeros_like(near), jac=jacobian, tol=AT_REST**1.5)
    return near + scale_m * found.x if np.linalg.norm(velocity(found.x)) < AT_REST else None


@torch.no_grad()
def _velocity(field: ChartedField, state: State) -> State:
    return np.asarray(field(torch.as_tensor(state)[None])[0].numpy())
