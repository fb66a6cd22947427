"""Rollouts in a safety region."""

import math

import numpy as np
import torch

from geomotion.dynamics.embedded import EmbeddedField
from geomotion.dynamics.fields import VectorField
from geomotion.dynamics.rollout import judge
from geomotion.errors import InvalidSetting
from geomotion.obstacles.safe_field import PLANE, follow_safely
from geomotion.safe_skills import SafeSkill, nearest_body_m
from geomotion.stages.phases import GOAL_TOLERANCE, REGION, Followed, Start
from geomotion.types import Float, States, Tensor, Times

MAX_STEP = 0.01  # of the field's time unit


@torch.no_grad()
def follow_in_region(safe: SafeSkill, start: Start) -> Followed:
    """Follow the skill in its region, in latent coordinates, where no step ends outside of it.

    Started beside the skill's surface, its latent point is what the region keeps; the distance to obstacles that is
    reported is that of the states themselves.

    Raises:
        InvalidSetting: If the skill's own decoder cannot begin beside its manifold.
    """
    skill, field = safe.skill, safe.charted_field()
    if not field.is_onto:
        raise InvalidSetting("safety", "riemannian", "a field on the whole space for rollouts: chart=flow")
    chart = safe.surface.plane.chart
    z = chart.to_latent(torch.from_numpy(start.state)[None].double())
    wanted = field.law_at(z).progress(torch.from_numpy(start.times) / field.time_unit_s)
    substeps = max(1, math.ceil(float(wanted.diff().max()) / MAX_STEP))
    codes, waited = follow_safely(safe.safe_field(), z, _refined(wanted, substeps))
    codes = codes[:, ::substeps]
    if field.transverse_law is not None:  # what the region does not steer has a clock of its own
        passed = field.transverse_law.progress(torch.from_numpy(start.times) / field.time_unit_s)
        codes[..., PLANE:] = _decayed(skill.field.field, z, passed)
    states = chart.to_ambient(codes)
    own = states.to(skill.goal)
    times = torch.from_numpy(start.times).to(own)
    geometry = skill.geometry
    centre, reach = torch.tensor(geometry.centre).to(own), REGION * 2 * geometry.scale_m
    box = (centre - reach, centre + reach)
    status = judge(field, own, times, skill.goal, GOAL_TOLERANCE * 2 * geometry.scale_m, box)[0]
    positions = states[0, :, : safe.surface.plane.position_dim].numpy()
    clearance_m = float(nearest_body_m(safe.bodies, positions).min())
    return Followed(
        own[0],
        field.velocity(own[0], times[:, None]),
        status,
        "rk4",
        f"{waited} steps were waited on the border of the safety region." if waited else "",
        clearance_m if np.isfinite(clearance_m) else None,
        (),
    )


def _decayed(field: VectorField, z: States, passed: Times) -> Float[Tensor, "start time rest"]:
    assert isinstance(field, EmbeddedField)
    return z[:, None, PLANE:] * (-field.transverse_rate.double() * passed[:, None]).exp()


def _refined(times: Float[Tensor, " time"], substeps: int) -> Float[Tensor, " other_time"]:
    """Times with equal steps between each two of them."""
    shares = torch.arange(substeps) / substeps
    between = times[:-1, None] + shares * times.diff()[:, None]
    return torch.cat([between.flatten(), times[-1:]])
