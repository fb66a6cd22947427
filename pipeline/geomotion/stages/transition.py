"""Rollouts of a decoded skill that are led to its manifold before they follow it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from geomotion.config import SolverConfig
from geomotion.dynamics.injective import decoder_of, transition
from geomotion.errors import InvalidSetting
from geomotion.obstacles.obstacle import clearance
from geomotion.stages.phases import Followed, Phase, Start, follow_phases


def follow_after_transition(
    all_phases: Sequence[Phase], start: Start, solver: SolverConfig, transition_s: float
) -> Followed:
    """Lead a start to the manifold, then follow the phases from there, whose clock begins then.

    Args:
        all_phases: Of a skill with a decoder; obstacles are where they are when the manifold is reached.
        start: Where and when.
        solver: How the motion on the manifold is computed.
        transition_s: Time until the manifold is reached [s].

    Raises:
        InvalidSetting: If the rollout ends before it is on the manifold.

    Source: Thesis Sec. 6.4.2.
    """
    if transition_s >= start.times[-1]:
        expected = f"less than the {start.times[-1]:.3g} s of the rollout, or null"
        raise InvalidSetting("rollout.transition_s", transition_s, expected)
    decoder, like = decoder_of(all_phases[0].skill.field), all_phases[0].skill.goal
    state = torch.as_tensor(start.state).to(like)
    during = start.times < transition_s
    shares = torch.as_tensor(start.times[during] / transition_s).to(like)
    states, velocities = transition(decoder, state, shares, transition_s)
    with torch.no_grad():
        projected = decoder.project(state).double().numpy()
    rest = replace(start, state=projected, times=np.asarray(start.times[~during] - transition_s))
    followed = follow_phases(all_phases, rest, solver, on_manifold=True)
    gaps = [] if followed.clearance_m is None else [followed.clearance_m]
    if (field := all_phases[0].field) is not None:
        before = torch.as_tensor(start.times[during] - transition_s).to(like)
        gaps.append(float(clearance(field.obstacles, field.position(states), before)))
    return replace(
        followed,
        clearance_m=min(gaps, default=None),
        states=torch.cat([states, followed.states]),
        velocities=torch.cat([velocities, followed.velocities]),
    )
