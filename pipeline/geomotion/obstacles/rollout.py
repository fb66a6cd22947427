"""Trajectories among obstacles that may move."""

from dataclasses import replace

import torch

from geomotion.dynamics.fields import TimedField
from geomotion.dynamics.rollout import Box, Method, Rollout, judge
from geomotion.dynamics.rollout import rollout as follow
from geomotion.obstacles.guarded import GuardedSolver
from geomotion.obstacles.modulation import ModulatedField
from geomotion.types import Float, Tensor, Times

ACCURACY = 1e-3  # of the smallest radius, for each step


def rollout_among_obstacles(
    field: ModulatedField,
    starts: Float[Tensor, "start D"],
    times: Times,
    *,
    method: Method = "auto",
    substeps: int = 1,
    relative_tolerance: float = 1e-6,
    absolute_tolerance: float = 1e-8,
    goal: Float[Tensor, " D"] | None = None,
    goal_tolerance: float = 1e-3,
    region: Box | None = None,
) -> Rollout:
    """Follow a modulated field from each start; obstacles are where their reference points say at ``times[0]``.

    Args:
        field: What to follow.
        starts: States at ``times[0]`` [m].
        times: Output times [s], increasing.
        method: ``dopri5`` keeps states outside of obstacles, see :class:`geomotion.obstacles.guarded.GuardedSolver`;
            ``auto`` does the same with a tolerance of `ACCURACY` times the smallest radius; ``rk4`` has fixed steps,
            which may enter by their error.
        substeps: Steps of ``rk4`` between two output times.
        relative_tolerance: Of ``dopri5``, for every trajectory.
        absolute_tolerance: Of ``dopri5``, for every trajectory [m].
        goal: Where trajectories should end [m].
        goal_tolerance: Distance below which two states count as the same [m].
        region: Lower and upper corner of the box that trajectories should end in.

    Raises:
        InvalidSetting: If a closed form is asked for.
    """
    if method in ("auto", "dopri5"):
        if method == "auto":
            smallest = min(obstacle.inradius for obstacle in field.obstacles)
            relative_tolerance, absolute_tolerance = 0.0, ACCURACY * smallest
        solver = GuardedSolver(field, relative_tolerance, absolute_tolerance)
        states = solver.solve(starts, times - times[0])
        found = Rollout(states, (), "dopri5", _note(solver.unfinished))
    else:
        timed = torch.cat([starts, torch.zeros_like(starts[:, :1])], dim=-1)
        found = follow(TimedField(field), timed, times, method=method, substeps=substeps)
        states = found.states[..., :-1]
    with torch.no_grad():
        at_end = field.at_time(float(times[-1] - times[0]))
        statuses = judge(at_end, states, times, goal, goal_tolerance, region)
    return replace(found, states=states, statuses=statuses)


def _note(unfinished: int) -> str:
    return (
        f"{unfinished} steps were less exact than asked for, though halved as often as allowed." if unfinished else ""
    )
