"""How a policy coped on the arm: deviations, recovery, end, effort and limits."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float

from geomotion.dynamics.moved_goal import MovedGoal
from geomotion.models import Skill
from geomotion.robot.arm import Arm
from geomotion.robot.disturbances import Measured
from geomotion.robot.field_policy import ArmStates, PoseStates
from geomotion.robot.policy_loop import PolicyRun
from geomotion.robot.recording import Tracking
from geomotion.robot.timed import RATE_HZ
from geomotion.scores.paths import PosePath
from geomotion.scores.pushes import Path
from geomotion.scores.recovery import Deviation, Recovery, recovery
from geomotion.stages.executed import finite_or_none
from geomotion.stages.policy_execution import Disturbances
from geomotion.stages.policy_motion import Undisturbed

BRAKING_S = 0.05  # until joints have lost the speed that a push gave them

States = Float[np.ndarray, "time D"]


@dataclass(frozen=True)
class Judgement:
    """What is said of a run.

    Attributes:
        deviation: From the undisturbed motion, at every step of the simulation.
        recoveries: From each disturbance.
        end_error_m: Distance of the position to the goal in the end; None of joints.
        end_error_rad: The same of the orientation, or of the joint that is farthest; None of positions.
        peak_speed_ratio: Highest speed of the tip while it is not pushed, of the highest without disturbance.
        energy_j: ∫ Σ |τ q̇| dt over all joints.
        largest_torque_share: Of what a motor can give.
        largest_velocity_share: Of the fastest that a joint may be.
    """

    deviation: Deviation
    recoveries: Sequence[Recovery]
    end_error_m: float | None
    end_error_rad: float | None
    peak_speed_ratio: float
    energy_j: float
    largest_torque_share: float
    largest_velocity_share: float

    def document(self, pushes: Disturbances, rate_per_s: float | None) -> dict[str, Any]:
        """As JSON types.

        Args:
            pushes: Those recovered from.
            rate_per_s: Of the certificate.
        """
        return {
            "largest_deviation_m": float(self.deviation.to_path_m.max()),
            "end_error_m": self.end_error_m,
            "end_error_rad": self.end_error_rad,
            "peak_speed_ratio": self.peak_speed_ratio,
            "energy_j": self.energy_j,
            "largest_torque_share": self.largest_torque_share,
            "largest_velocity_share": self.largest_velocity_share,
            "pushes": [
                {
                    "kind": type(push).__name__.lower(),
                    "time_s": push.time_s,
                    "end_s": push.end_s,
                    "pushed_m": found.pushed_m,
                    "back_s": {str(limit_mm): finite_or_none(time_s) for limit_mm, time_s in found.back_s.items()},
                    "claimed_rate_per_s": finite_or_none(found.claimed_rate_per_s),
                    "certified_rate_per_s": rate_per_s,
                }
                for push, found in zip(pushes, self.recoveries, strict=True)
            ],
        }


def judge_run(
    skill: Skill,
    states: ArmStates,
    moved: MovedGoal | None,
    arm: Arm,
    alone: Undisturbed,
    pushes: Disturbances,
    run: PolicyRun,
    effort_nm: Float[np.ndarray, " joint"],
) -> Judgement:
    """Compare what the arm did with what the policy would have done alone.

    Args:
        skill: What was learned.
        states: Its states on the arm, read from the start on.
        moved: Where the goal went.
        arm: What moved.
        alone: The undisturbed motion.
        pushes: In the order in which they begin.
        run: What the arm did.
        effort_nm: What each motor can give [N m].
    """
    tracking, executed = run.tracking, executed_states(states, run.tracking)
    deviation = _deviation(skill, moved, alone, run, executed)
    changes_s = [] if moved is None else moved.times_s.tolist()
    events_s = sorted([*(push.time_s for push in pushes), *changes_s, float(tracking.time_s[-1])])
    recoveries = [recovery(deviation, push.time_s, push.end_s, _next(events_s, push.end_s)) for push in pushes]
    power_w = np.abs(run.torque_nm * run.velocity_rad_per_s).sum(axis=1)
    return Judgement(
        deviation,
        recoveries,
        *_end_error(skill, states, moved, executed[-1], float(tracking.time_s[-1])),
        _peak_speed_ratio(alone, pushes, run),
        float(power_w.sum() / RATE_HZ),
        float((np.abs(run.torque_nm) / effort_nm).max()),
        float((np.abs(run.velocity_rad_per_s) / arm.limits.velocity_rad_per_s).max()),
    )


def executed_states(states: ArmStates, tracking: Tracking) -> States:
    """States at every step of the simulation, read from the start on."""
    rows = zip(tracking.position_m, tracking.orientation_wxyz, tracking.joints_rad, strict=True)
    return np.array([states.state(Measured(*row)) for row in rows])


def _next(events_s: Sequence[float], time_s: float) -> float:
    return next((event_s for event_s in events_s if event_s > time_s), time_s)


def _deviation(
    skill: Skill, moved: MovedGoal | None, alone: Undisturbed, run: PolicyRun, executed: States
) -> Deviation:
    time_s = run.tracking.time_s
    then = np.stack([np.interp(time_s, alone.time_s, coordinate) for coordinate in alone.states.T], axis=-1)
    difference = _claimed(skill, moved, time_s, executed) - _claimed(skill, moved, time_s, then)
    aside_m = Path(alone.position_m).distances(run.tracking.position_m)
    return Deviation(time_s, aside_m, np.linalg.norm(difference, axis=1))


@torch.no_grad()
def _claimed(skill: Skill, moved: MovedGoal | None, time_s: Float[np.ndarray, " time"], states: States) -> States:
    """ψ of states, seen from where the goal is and without what is remembered of the start."""
    x, elapsed_s = torch.tensor(states, dtype=torch.float32), torch.tensor(time_s, dtype=torch.float32)[:, None]
    if moved is not None:
        x = x - moved.shift(elapsed_s)
    if skill.field.carried is not None:
        x = x - skill.field.carried.at(elapsed_s)
    return np.asarray(skill.field.chart.to_latent(x).double().numpy())


def _end_error(
    skill: Skill, states: ArmStates, moved: MovedGoal | None, end: Float[np.ndarray, " D"], time_s: float
) -> tuple[float | None, float | None]:
    goal = skill.goal.double().numpy()
    if moved is not None:
        goal = goal + moved.shift(torch.tensor([time_s])).double().numpy()
    if isinstance(states, PoseStates):
        reached, wanted = (PosePath(*states.poses(one[None])) for one in (end, goal))
        apart_m, apart_rad = reached.residuals(wanted)
        return float(apart_m[0]), float(apart_rad[0])
    if len(goal) == len(end) and skill.state_channels == ("joints_rad",):
        return None, float(np.abs(end - goal).max())
    return float(np.linalg.norm(end - goal)), None


def _peak_speed_ratio(alone: Undisturbed, pushes: Disturbances, run: PolicyRun) -> float:
    time_s = run.tracking.time_s
    is_free = np.ones(len(time_s), dtype=bool)
    for push in pushes:
        is_free &= (time_s <= push.time_s) | (time_s > push.end_s + BRAKING_S)
    nominal = np.linalg.norm(np.gradient(alone.position_m, alone.time_s, axis=0), axis=1).max()
    return float(run.speed_m_per_s[is_free].max() / nominal) if is_free.any() and nominal > 0 else math.nan
