"""What is known about contraction, in sentences for people who want to run the motion on a robot."""

from collections.abc import Mapping
from math import log
from typing import Any

import numpy as np

from geomotion.figures.arrays import Array, EigenvalueGrid
from geomotion.figures.report.verdict import Verdict
from geomotion.figures.style import percent

Certificate = Mapping[str, Any]

HEADLINES = {
    "by_construction": "Contracting by construction",
    "verified_on_set": "Contracting on a verified set",
    "measured_only": "No guarantee: contraction is measured only",
}
HOLDS = {
    "by_construction": "from any two starts, whatever training found",
    "verified_on_set": "from any two starts in the verified set",
}


def verdict(certificate: Certificate, grid: EigenvalueGrid | None) -> Verdict:
    """Put a certificate and the measured eigenvalues into words.

    Args:
        certificate: Contents of ``certificate.json``; absent entries are left out.
        grid: Measured eigenvalues, where there are any.
    """
    claim, details = _claim(certificate), facts(certificate, grid)
    if claim == "measured_only":
        return Verdict("measured", HEADLINES[claim], _measured_sentences(grid), details)
    sentences = (_proven_sentence(claim, certificate), _robot_coordinates_sentence(certificate, grid))
    failing = 0.0 if grid is None else not_contracting(grid.claimed)
    if failing == 0.0:
        return Verdict("proven", HEADLINES[claim], sentences, details)
    objection = (
        f"Yet {percent(failing)} of the points checked do not contract in the claimed metric. "
        "Do not rely on the claim before the reason is known."
    )
    return Verdict("contradicted", "Claim and measurement disagree", (*sentences, objection), details)


def not_contracting(eigenvalues: Array) -> float:
    """Share of points whose largest eigenvalue is not negative, or not a number."""
    return float(np.mean(~(eigenvalues < 0)))


def facts(certificate: Certificate, grid: EigenvalueGrid | None) -> tuple[tuple[str, str], ...]:
    """Names and values behind the verdict."""
    rate, overshoot = certificate.get("rate_per_s"), certificate.get("overshoot")
    found = {
        "Claim": _claim(certificate).replace("_", " "),
        "Metric": str(certificate.get("metric", "not stated")),
        "Proven rate": "none" if rate is None else f"{rate:.3g} 1/s",
        "Grounds": str(certificate.get("reason", "not stated")),
    }
    if overshoot:
        numbers = f"median {overshoot['median']:.3g}, worst {overshoot['worst']:.3g}"
        found["Condition number of Dψ on demonstrated states"] = (
            f"{numbers}: bounds how far distances may grow at first"
        )
    if grid is not None:
        found["Not contracting, robot coordinates"] = _measured(grid.true)
        found["Not contracting, claimed metric"] = _measured(grid.claimed)
    if grid is not None and grid.jhat is not None:
        found["The same for Ĵ of Eq. (5.1), which is not the field's Jacobian"] = _measured(grid.jhat)
    return tuple(found.items())


def _claim(certificate: Certificate) -> str:
    claim = str(certificate.get("claim"))
    is_proven = claim in HOLDS and certificate.get("rate_per_s") is not None
    return claim if is_proven else "measured_only"


def _measured(eigenvalues: Array) -> str:
    share = percent(not_contracting(eigenvalues))
    return f"{share} of {len(eigenvalues)} points; largest eigenvalue {eigenvalues.max():.3g} 1/s"


def _measured_sentences(grid: EigenvalueGrid | None) -> tuple[str, ...]:
    claim = "Nothing guarantees that motions from different starts come together."
    if grid is None:
        return claim, "Nor was it measured: the evaluation holds no eigenvalues."
    share = percent(not_contracting(grid.true))
    matrix = (
        ""
        if grid.jhat is None
        else f" (the network's matrix Ĵ alone would suggest {percent(not_contracting(grid.jhat))})"
    )
    return claim, (
        f"At {share} of the {len(grid.true)} points checked around the demonstrations, nearby motions at first part "
        f"instead of approaching each other{matrix}."
    )


def _proven_sentence(claim: str, certificate: Certificate) -> str:
    rate = float(certificate["rate_per_s"])
    return (
        f"Motions come together {HOLDS[claim]}: their distance, in a metric that was learned with the motion, halves "
        f"at least every {log(2) / rate:.2g} s (rate {rate:.2g} 1/s)."
    )


def _robot_coordinates_sentence(certificate: Certificate, grid: EigenvalueGrid | None) -> str:
    parts = ["Measured in the robot's own coordinates, distances may grow before they shrink"]
    if overshoot := certificate.get("overshoot"):
        parts.append(f"at worst about {overshoot['worst']:.2g}-fold near the demonstrations")
    if grid is not None:
        parts.append(f"at {percent(not_contracting(grid.true))} of {len(grid.true)} points checked they do so at first")
    return ", ".join(parts) + "."
