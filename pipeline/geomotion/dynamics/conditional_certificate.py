"""The certificate of a field with conditions, from those of the fields that single conditions give."""

from collections.abc import Sequence
from dataclasses import replace

from geomotion.dynamics.certificate import Certificate, Claim, Overshoot

EVERY_CONDITION = (
    " This holds for every condition, shown or not: the condition chooses the chart and the equilibrium, not the rate. "
    "A change of condition on the way changes the metric once; from then on distances fall at the same rate."
)


def for_all_conditions(certificates: Sequence[Certificate]) -> Certificate:
    """One claim for all conditions: the slowest rate, and of each number of the overshoot the largest.

    Args:
        certificates: Of the demonstrated conditions, one or more; of one kind, as they are of one model.
    """
    first = certificates[0]
    rates = [certificate.rate_per_s for certificate in certificates if certificate.rate_per_s is not None]
    overshoots = [certificate.overshoot for certificate in certificates if certificate.overshoot is not None]
    worst = [max(values) for values in zip(*((one.median, one.worst, one.bound) for one in overshoots), strict=True)]
    return replace(
        first,
        rate_per_s=min(rates) if rates else None,
        reason=first.reason + (EVERY_CONDITION if first.claim is Claim.by_construction else ""),
        overshoot=Overshoot(*worst) if worst else None,
    )
