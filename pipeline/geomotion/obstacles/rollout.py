"""Trajectories among obstacles that may move."""

from dataclasses import replace
from typing import Any

import torch

from geomotion.dynamics.rollout import Rollout, judge
from geomotion.dynamics.rollout import rollout as follow
from geomotion.obstacles.modulation import ModulatedField, TimedField
from geomotion.types import Float, Tensor, Times


def rollout_among_obstacles(
    field: ModulatedField,
    starts: Float[Tensor, "start D"],
    times: Times,
    *,
    goal: Float[Tensor, " D"] | None = None,
    goal_tolerance: float = 1e-3,
    **solver: Any,
) -> Rollout:
    """Follow a modulated field from each start; obstacles are where their reference points say at ``times[0]``.

    Args:
        field: What to follow.
        starts: States at ``times[0]`` [m].
        times: Output times [s], increasing.
        goal: Where trajectories should end [m].
        goal_tolerance: Distance below which two states count as the same [m].
        solver: Method, steps and tolerances of :func:`geomotion.dynamics.rollout.rollout`.

    Raises:
        InvalidSetting: If a closed form is asked for.
    """
    clock = torch.zeros_like(starts[:, :1])
    outcome = follow(TimedField(field), torch.cat([starts, clock], dim=-1), times, **solver)
    states = outcome.states[..., :-1]
    with torch.no_grad():
        at_end = field.at_time(float(times[-1] - times[0]))
        statuses = judge(at_end, states, times, goal, goal_tolerance, region=None)
    return replace(outcome, states=states, statuses=statuses)
