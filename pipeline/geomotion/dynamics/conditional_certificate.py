"""The certificate of a field with conditions, from those of the fields that single conditions give."""

from collections.abc import Sequence
from dataclasses import replace

from geomotion.dynamics.certificate import Certificate, Claim, Overshoot

EVERY_CONDITION = (
    " The same holds under every condition, shown or not, in a metric of its own, at a rate that is, per duration of "
    "its motions, at least field.min_rate_per_duration times the smallest speed of a time law "
    "(field.transverse_rate_per_duration times field.transverse_start, if that is less and field.skill_dim is set). "
    "The rate given here is that of the slowest demonstrated condition. A change of condition on the way changes the "
    "metric once; from then on distances fall at the rate of the new one."
)


def for_all_conditions(certificates: Sequence[Certificate]) -> Certificate:
    """One claim for all conditions: that of the slowest, with the largest of each number of the overshoot.

    Args:
        certificates: Of the demonstrated conditions, one or more; of one kind, as they are of one model.
    """
    slowest = min(certificates, key=lambda certificate: certificate.rate_per_s or 0.0)
    overshoots = [certificate.overshoot for certificate in certificates if certificate.overshoot is not None]
    worst = [max(values) for values in zip(*((one.median, one.worst, one.bound) for one in overshoots), strict=True)]
    return replace(
        slowest,
        reason=slowest.reason + (EVERY_CONDITION if slowest.claim is Claim.by_construction else ""),
        overshoot=Overshoot(*worst) if worst else None,
    )
