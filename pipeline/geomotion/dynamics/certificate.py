"""What is claimed about the contraction of a field, in which metric, at what rate, and why."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import Enum
from typing import Any

import torch

from geomotion.dynamics.embedded import EmbeddedField
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.line_integral import LineIntegralField
from geomotion.dynamics.linear import LinearField
from geomotion.dynamics.potential import PotentialField
from geomotion.types import Float, States, Tensor

PROOFS: Mapping[type, str] = {
    LinearField: "The field is linear in the coordinates z = ψ(x), and the symmetric part of its matrix is at most -τI "
    "for every value of its parameters.",
    PotentialField: "In the coordinates z = ψ(x) the field is the negative gradient of a strongly convex function plus "
    "a constant rotation: the symmetric part of its Jacobian is at most -τI everywhere, for every value of its "
    "parameters.",
}
WITH_DECAY = (
    " The coordinates of the skill are {skill_dim} of {dim}; the others decay at the rate k, so the Jacobian is "
    "block-diagonal and the field contracts in all dimensions, at the lesser of both rates."
)
WITH_MEMORY = (
    " A motion remembers how far from the mean start it began, and carries this offset along, which fades out within "
    "{fade_s:.3g} s{remainder}. The claim is one of motions that remember the same start, as those of a pushed robot "
    "do, in the metric at the state less what it carries along. Two undisturbed motions from different starts come "
    "together as the offset fades, not at the rate."
)
WITH_REMAINDER = ", and what its path lacks in the field, for {span_s:.3g} s"
NOT_A_JACOBIAN = (
    "The matrix field of Eq. (5.1) is negative definite, but it is in general not the Jacobian of the line integral of "
    "Eq. (5.2): its rows are not gradients. Contraction is therefore measured on the true Jacobian."
)
ON_MANIFOLD = (
    " This holds on the manifold of the decoder, which is a diffeomorphism from the codes z to it. Beside the manifold "
    "nothing is claimed: a state there moves as its projection does, and nothing brings it back."
)
UNCONSTRAINED = (
    "Nothing in this network keeps the symmetric part of its Jacobian negative. Whether it contracts can only be "
    "measured."
)


class Claim(Enum):
    """How much is known about contraction."""

    by_construction = "by_construction"  # holds for every value of the parameters
    by_construction_on_manifold = "by_construction_on_manifold"  # the same, for states that a decoder reaches
    verified_on_set = "verified_on_set"  # bounded on a stated set
    measured_only = "measured_only"  # sampled; nothing is known between and beyond the samples


@dataclass(frozen=True)
class Overshoot:
    """How the claimed metric distorts the robot's own distances on the demonstrated states.

    Attributes:
        median: Median condition number of Dψ(x).
        worst: Largest condition number of Dψ(x): how much a small distance at x can grow, at most, near x. Where the
            chart is a decoder, directions are those of its manifold.
        bound: Largest over smallest singular value of Dψ anywhere on those states: trajectories that stay among them
            keep ‖x_t - y_t‖ ≤ bound · e^{-τt} ‖x_0 - y_0‖, measured along curves among them.
    """

    median: float
    worst: float
    bound: float


@dataclass(frozen=True)
class Certificate:
    """A claim about contraction and the grounds for it.

    Attributes:
        claim: How much is known.
        metric: The Riemannian metric in which trajectories approach each other.
        rate_per_s: Proven rate τ [1/s]: distances in `metric` fall at least as fast as e^{-τt}; None if unproven.
        reason: Why the claim holds, or why it is only measured.
        overshoot: What the metric means in the robot's own coordinates.
        audit: Measured numbers that bear on the claim.
        verified_set: The box on which a claim is verified: its corners, in metres (``lower_m``, ``upper_m``) or in the
            chart's coordinates (``lower``, ``upper``); None for other claims.
    """

    claim: Claim
    metric: str
    rate_per_s: float | None
    reason: str
    overshoot: Overshoot | None = None
    audit: Mapping[str, float] = field(default_factory=dict)
    verified_set: Mapping[str, list[float]] | None = None

    def as_dict(self) -> dict[str, Any]:
        """Plain types, for JSON."""
        return asdict(self) | {"claim": self.claim.value}


def certify(model: ChartedField, states: States) -> Certificate:
    """The certificate of a model; a field without a proof here says by its attribute `claim` what its method claims.

    Args:
        model: The trained field.
        states: Demonstrated states [m], where the overshoot is evaluated.
    """
    overshoot = chart_distortion(model, states)
    field, place = model.field, "" if model.is_onto else ON_MANIFOLD
    if isinstance(field, LinearField | PotentialField | EmbeddedField):
        return Certificate(
            Claim.by_construction if model.is_onto else Claim.by_construction_on_manifold,
            "M(x) = Dψ(x)ᵀDψ(x), the pullback of the Euclidean metric through the chart ψ",
            slowest_rate(model) / model.time_unit_s,
            _proof(field) + _about_time(model) + _about_starts(model) + place,
            overshoot,
        )
    reason = NOT_A_JACOBIAN if isinstance(field, LineIntegralField) else getattr(field, "claim", UNCONSTRAINED)
    metric = "Euclidean metric of the chart's coordinates"
    return Certificate(Claim.measured_only, metric, None, reason + place, overshoot)


def _proof(field: LinearField | PotentialField | EmbeddedField) -> str:
    if isinstance(field, EmbeddedField):
        return PROOFS[type(field.field)] + WITH_DECAY.format(skill_dim=field.skill_dim, dim=field.dim)
    return PROOFS[type(field)]


def slowest_rate(model: ChartedField) -> float:
    """The rate at which a field that contracts by construction does at any time, per time unit."""
    field = model.field
    assert isinstance(field, LinearField | PotentialField | EmbeddedField)
    if model.transverse_law is None or not isinstance(field, EmbeddedField):
        return model.slowest * field.rate
    return min(model.slowest * field.field.rate, model.transverse_law.slowest() * float(field.transverse_rate))


def decay_over_duration(model: ChartedField) -> float:
    """By which power of e distances fall at least over the mean duration."""
    field, whole = model.field, torch.ones(1)
    assert isinstance(field, LinearField | PotentialField | EmbeddedField)
    if model.transverse_law is None or not isinstance(field, EmbeddedField):
        return field.rate
    return min(field.field.rate, float(field.transverse_rate * model.transverse_law.progress(whole)))


def _about_time(model: ChartedField) -> str:
    if model.time_law is None:
        return ""
    own_clock = ""
    if model.transverse_law is not None:
        own_clock = f"; beside the skill, a clock of its own does, {model.transverse_law.slowest():.2g} at the least"
    return (
        f" Its time law multiplies velocities by a positive number, {model.slowest:.2g} at the least{own_clock}. The "
        f"rate accounts for this; over the mean duration of {model.time_unit_s:.3g} s distances fall by "
        f"e^-{decay_over_duration(model):.3g}."
    )


def _about_starts(model: ChartedField) -> str:
    memory = model.start_memory
    if memory is None:
        return ""
    is_bare = not memory.remainder.coefficients.any()
    remainder = "" if is_bare else WITH_REMAINDER.format(span_s=float(memory.span_s))
    return WITH_MEMORY.format(fade_s=float(memory.fade_s), remainder=remainder)


def chart_distortion(model: ChartedField, states: States) -> Overshoot:
    """Singular values of Dψ at the given states, summarised."""
    singular = torch.linalg.svdvals(inverse_chart_jacobian(model, states).double())
    condition = singular[:, 0] / singular[:, -1]
    return Overshoot(float(condition.median()), float(condition.max()), float(singular.max() / singular.min()))


def inverse_chart_jacobian(model: ChartedField, x: States) -> Float[Tensor, "point D d"]:
    """Dψ(x)⁻¹, or the decoder's Jacobian where the chart is one: the push-forward of each unit vector."""
    with torch.no_grad():
        z, push_forward = model.chart.linearise(x)
        columns = [push_forward(unit.expand_as(z)) for unit in torch.eye(z.shape[-1], dtype=x.dtype)]
    return torch.stack(columns, dim=-1)
