"""What is known about contraction, in sentences for people who want to run the motion on a robot."""

from collections.abc import Mapping
from dataclasses import replace
from math import log
from typing import Any

import numpy as np

from geomotion.figures.arrays import Array, EigenvalueGrid
from geomotion.figures.report.verdict import Verdict
from geomotion.figures.style import percent

Certificate = Mapping[str, Any]

HEADLINES = {
    "by_construction": "Contracting by construction",
    "by_construction_on_manifold": "Contracting by construction, on the decoder's manifold alone",
    "verified_on_set": "Contracting on a verified set",
    "measured_only": "No guarantee: contraction is measured only",
}
HOLDS = {
    "by_construction": "Two motions come together from any two starts, whatever training found",
    "by_construction_on_manifold": "Two motions come together from any two starts on the decoder's manifold",
    "verified_on_set": "Two motions come together as long as both stay inside a box around the demonstrations",
}
PLAIN = {
    "by_construction": "These are distances in the robot's own coordinates: a push is forgotten from its first moment.",
    "by_construction_on_manifold": "A push off the manifold is carried along; nothing is claimed there.",
    "verified_on_set": "Outside the box nothing is proven, and neither is that motions stay inside.",
}
LEARNED = ", in a metric that was learned with the motion,"
SHARES = {"contracting": "contracting", "not contracting": "not_contracting", "undecided": "undecided"}  # of the box
UNDISTORTED = 1 + 1e-3  # condition number of Dψ: the metric is the plain one


def verdict(certificate: Certificate, grid: EigenvalueGrid | None) -> Verdict:
    """Put a certificate and the measured eigenvalues into words.

    Args:
        certificate: Contents of ``certificate.json``; absent entries are left out.
        grid: Measured eigenvalues, where there are any.
    """
    found = _free_space(certificate, grid)
    if obstacles := certificate.get("obstacles"):
        return replace(found, sentences=(*found.sentences, _among_obstacles(obstacles["measured"])))
    return found


def _free_space(certificate: Certificate, grid: EigenvalueGrid | None) -> Verdict:
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
    if attempt := _attempt(certificate):
        found["Proof on the box around the demonstrations"] = attempt
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


def _attempt(certificate: Certificate) -> str:
    """How far a proof got, where one was tried."""
    audit = certificate.get("audit") or {}
    shares = {name: audit.get(f"verification.{key}") for name, key in SHARES.items()}
    return ", ".join(f"{name} {percent(share)}" for name, share in shares.items() if share is not None)


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
    metric = LEARNED if _is_distorted(certificate) else ""
    return f"{HOLDS[claim]}: their distance{metric} halves at least every {log(2) / rate:.2g} s (rate {rate:.2g} 1/s)."


def _among_obstacles(measured: Mapping[str, float | None]) -> str:
    """What obstacles leave of it."""
    shares = (
        ("obstacles.contraction.claimed.non_contracting_fraction", "of the points do not contract in that metric"),
        ("obstacles.contraction.true.non_contracting_fraction", "not in the robot's coordinates"),
        ("obstacles.passage.never_reached", "of the starts do not reach the goal"),
    )
    known = [f"{percent(share)} {text}" for name, text in shares if (share := measured.get(name)) is not None]
    return f"All this is about free space; among the obstacles it was measured: {', '.join(known)}."


def _is_distorted(certificate: Certificate) -> bool:
    overshoot = certificate.get("overshoot")
    return not overshoot or max(overshoot.values()) > UNDISTORTED


def _robot_coordinates_sentence(certificate: Certificate, grid: EigenvalueGrid | None) -> str:
    if not _is_distorted(certificate):
        return PLAIN[_claim(certificate)]
    parts = ["Measured in the robot's own coordinates, distances may grow before they shrink"]
    if overshoot := certificate.get("overshoot"):
        parts.append(f"at worst about {overshoot['worst']:.2g}-fold near the demonstrations")
    if grid is not None:
        parts.append(f"at {percent(not_contracting(grid.true))} of {len(grid.true)} points checked they do so at first")
    return ", ".join(parts) + "."
