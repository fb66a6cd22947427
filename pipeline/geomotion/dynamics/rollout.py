"""Trajectories of a vector field from many starts at once, each with a verdict on how it ended."""

from dataclasses import dataclass
from enum import Enum
from typing import Any, Literal

import torch
from torchdiffeq import odeint

from geomotion.dynamics.fields import ChartedField, Plan, TimedField, VectorField, has_closed_form
from geomotion.errors import InvalidSetting
from geomotion.types import Float, State, Tensor, Times, Trajectories

Method = Literal["auto", "closed_form", "rk4", "dopri5"]
Box = tuple[Float[Tensor, " D"], Float[Tensor, " D"]]

MAX_ADAPTIVE_STEPS = 10_000  # between two output times
ADAPTIVE_FAILURES = ("underflow in dt", "non-finite values", "max_num_steps exceeded")


class RolloutStatus(Enum):
    """How a trajectory ends, judged by its last state; the value is a sentence for people."""

    reached = "The trajectory ends at the goal."
    stopped_elsewhere = "The trajectory comes to rest away from the goal: there is another equilibrium."
    left_region = "The trajectory ends outside the given region."
    diverged = "The trajectory becomes infinite; if the field is steep, more solver substeps may prevent it."
    moving = "The trajectory is still on its way; a longer duration would tell where it goes."


@dataclass(frozen=True)
class Rollout:
    """Trajectories and what became of them.

    Attributes:
        states: States at the output times, shape (start, time, D).
        statuses: How each trajectory ends.
        method: What computed them.
        note: What differs from what was asked for; empty if nothing.
    """

    states: Float[Tensor, "start time D"]
    statuses: tuple[RolloutStatus, ...]
    method: Method
    note: str = ""


@torch.no_grad()
def rollout(
    field: VectorField,
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
    """Follow a field from each start.

    Args:
        field: The field; one that changes with time begins at ``times[0]``.
        starts: States at ``times[0]``; a field that remembers starts remembers these.
        times: Output times [s], increasing.
        method: ``auto`` takes the closed form where there is one and ``rk4`` otherwise. ``dopri5`` falls back to
            ``rk4``, with a note in the result, where its step size collapses.
        substeps: Steps of ``rk4`` between two output times.
        relative_tolerance: Of ``dopri5``, for every coordinate of every trajectory.
        absolute_tolerance: Of ``dopri5``, for every coordinate of every trajectory [m].
        goal: Where trajectories should end.
        goal_tolerance: Distance below which two states count as the same [m].
        region: Lower and upper corner of the box that trajectories should end in.

    Raises:
        InvalidSetting: If a closed form is asked for and there is none.
    """
    field = _begun(field, starts)
    method = _resolve(field, method)
    note = ""
    if method == "closed_form":
        states = field.solve(starts, (times - times[0]).to(starts))  # type: ignore[attr-defined]
    autonomous, augmented = _autonomous(field, starts)
    if method == "dopri5":
        try:
            states = _dopri5(autonomous, augmented, times, relative_tolerance, absolute_tolerance)
        except _StepSizeCollapsed as failure:
            method, note = "rk4", f"dopri5 failed ({failure}); computed with rk4, {substeps} step(s) per output time."
    if method == "rk4":
        states = _rk4(autonomous, augmented, times, substeps)
    states = states[..., : field.dim]
    statuses = judge(field, states, times, goal, goal_tolerance, region)
    return Rollout(states, statuses, method, note)


def judge(
    field: VectorField,
    states: Float[Tensor, "start time D"],
    times: Times,
    goal: Float[Tensor, " D"] | None,
    goal_tolerance: float,
    region: Box | None,
) -> tuple[RolloutStatus, ...]:
    """How each trajectory ends.

    In this order: diverged (some state is not finite), reached (ends within the tolerance of the goal), left_region
    (ends outside the box), stopped_elsewhere (so slow that, at the present speed, it would stay within the tolerance
    for as long again as the rollout took), moving. A goal or region that is not given is not judged.
    """
    last = states[:, -1]
    drift = _speed_at_end(field, states, times) * (times[-1] - times[0])
    verdicts = {RolloutStatus.diverged: ~states.isfinite().all(dim=(-1, -2))}
    if goal is not None:
        verdicts[RolloutStatus.reached] = (last - goal).norm(dim=-1) <= goal_tolerance
    if region is not None:
        verdicts[RolloutStatus.left_region] = ((last < region[0]) | (last > region[1])).any(dim=-1)
    verdicts[RolloutStatus.stopped_elsewhere] = drift < goal_tolerance
    verdicts[RolloutStatus.moving] = torch.ones_like(drift, dtype=torch.bool)
    first_true = torch.stack(list(verdicts.values())).int().argmax(dim=0)
    options = tuple(verdicts)
    return tuple(options[index] for index in first_true.tolist())


def _speed_at_end(field: VectorField, states: Trajectories, times: Times) -> Float[Tensor, " start"]:
    speeds: Tensor
    if isinstance(field, ChartedField) and isinstance(field.field, Plan):
        speeds = (states[:, -1] - states[:, -2]).norm(dim=-1) / (times[-1] - times[-2])
        return speeds
    speeds = field(states[:, -1]).norm(dim=-1)
    return speeds


class _StepSizeCollapsed(Exception):
    """The adaptive solver gave up."""


def _begun(field: VectorField, starts: State) -> VectorField:
    return field.begun(starts) if isinstance(field, ChartedField) else field


def _resolve(field: VectorField, method: Method) -> Method:
    solvable = has_closed_form(field)
    if method == "auto":
        return "closed_form" if solvable else "rk4"
    if method == "closed_form" and not solvable:
        raise InvalidSetting("solver.method", method, "auto, rk4 or dopri5, because this field has no closed form")
    return method


def _autonomous(field: VectorField, starts: State) -> tuple[VectorField, Float[Tensor, "*batch augmented"]]:
    """A field that changes with time as one of states and their clock, which starts at zero."""
    if isinstance(field, ChartedField) and field.time_law is not None:
        return TimedField(field), torch.cat([starts, torch.zeros_like(starts[..., :1])], dim=-1)
    return field, starts


def _rk4(field: VectorField, starts: State, times: Times, substeps: int) -> Trajectories:
    states = [starts]
    for step in (times.diff() / substeps).to(starts):
        state = states[-1]
        for _ in range(substeps):
            state = _rk4_step(field, state, step)
        states.append(state)
    return torch.stack(states, dim=-2)


def _rk4_step(field: VectorField, x: State, step: Float[Tensor, ""]) -> State:
    k1 = field(x)
    k2 = field(x + step / 2 * k1)
    k3 = field(x + step / 2 * k2)
    k4 = field(x + step * k3)
    return x + step / 6 * (k1 + 2 * (k2 + k3) + k4)


def _dopri5(field: VectorField, starts: State, times: Times, rtol: float, atol: float) -> Trajectories:
    # The largest error instead of torchdiffeq's root mean square: otherwise accuracy falls with the number of starts.
    options: dict[str, Any] = {"norm": lambda error: error.abs().max(), "max_num_steps": MAX_ADAPTIVE_STEPS}
    try:
        states: Tensor = odeint(
            lambda _, x: field(x), starts, times, method="dopri5", rtol=rtol, atol=atol, options=options
        )
    except AssertionError as error:
        if not str(error).startswith(ADAPTIVE_FAILURES):
            raise
        raise _StepSizeCollapsed(str(error).splitlines()[0]) from error
    return states.movedim(0, -2)
