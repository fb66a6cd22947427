"""Whether a learned field contracts, measured on its true Jacobian (thesis Sec. 5.2, 6.4.3).

Signs follow Tables 5.1 and 5.2: the rate is the largest eigenvalue of the symmetric part, and negative contracts.
"""

import copy

import numpy as np
from jaxtyping import Float

from geomotion.dynamics.fields import ChartedField
from geomotion.scores.evaluation import Evaluation
from geomotion.scores.jacobians import Eigenvalues, eigenvalues_in_metric, field_jacobian, symmetric_eigenvalues
from geomotion.scores.score import Score, max_score, mean_score, share_score
from geomotion.types import States

LARGEST, SMALLEST = "eigenvalue", "smallest_eigenvalue"
ARRAYS = tuple(f"{name}_{which}" for name in ("true", "claimed", "jhat") for which in (LARGEST, SMALLEST))


def judge_contraction(field: ChartedField, points: States, note: str) -> Evaluation:
    """Contraction in robot coordinates, in those where it is claimed, and of the matrix Ĵ where the field has one.

    Args:
        field: The field.
        points: Where to judge it [m].
        note: How the points were chosen.

    Source:
        Thesis Eq. (2.15), Tables 5.1 and 5.2; Eq. (5.1) for Ĵ.
    """
    latent = field.chart.to_latent(points).detach()
    true = symmetric_eigenvalues(field_jacobian(field, points))
    claimed = symmetric_eigenvalues(field_jacobian(field.field, latent)) / field.time_unit_s
    spectra = {
        "true": _numbers(true),
        "claimed": _numbers(claimed),
    }
    omitted = {}
    matrix = getattr(field.field, "contraction_jacobian", None)
    if matrix is None:
        omitted["contraction.jhat"] = "only a line-integral field has a matrix Ĵ, Eq. (5.1)"
    else:
        spectra["jhat"] = _numbers(symmetric_eigenvalues(matrix(latent)) / field.time_unit_s)
    notes = {
        "true": f"true Jacobian, robot coordinates; {note}",
        "claimed": f"true Jacobian in the coordinates where contraction is claimed; {note}",
        "jhat": f"the network's matrix of Eq. (5.1), not the Jacobian of the field; {note}",
    }
    scores = {
        f"contraction.{name}.{quantity}": score
        for name, eigenvalues in spectra.items()
        for quantity, score in contraction_scores(eigenvalues, notes[name]).items()
    }
    arrays = {f"{name}_{LARGEST}": eigenvalues[:, -1] for name, eigenvalues in spectra.items()}
    arrays |= {f"{name}_{SMALLEST}": eigenvalues[:, 0] for name, eigenvalues in spectra.items()}
    return Evaluation(scores, {"jhat_eigenvalue": np.empty(0)} | arrays, omitted)


def judge_condition(field: ChartedField, points: States, rate: float, note: str) -> Evaluation:
    r"""By how much a field misses the contraction that is claimed in the metric of its chart.

    .. math:: \max_x \lambda_{\max}\!\left(M^{-1} (M J + J^\top M + \dot M) / 2\right) + \tau \le 0,
        \qquad M = D\psi^\top D\psi

    J is that of the field in the robot's coordinates; the latent field is not looked at.

    Args:
        field: The field; it is judged in double precision.
        points: Where to judge it [m].
        rate: τ [1/s].
        note: How the points were chosen.

    Source:
        Thesis Eq. (2.15).
    """
    exact = copy.deepcopy(field).double().eval()
    margins = eigenvalues_in_metric(exact, exact.chart, points.double())[:, -1] + rate
    statement = f"largest eigenvalue of M⁻¹(MJ + JᵀM + Ṁ)/2, plus the proven rate: at most 0 up to rounding; {note}"
    return Evaluation({"contraction.condition.margin": max_score(margins.numpy(), "1/s", statement)})


def contraction_scores(eigenvalues: Float[np.ndarray, "point D"], note: str) -> dict[str, Score]:
    """Scores of eigenvalues of the symmetric part, ascending at each point [1/s].

    ``rate`` is the largest of all (the contraction rate of the set of points); ``mean_rate`` the mean over points
    of the largest, which Sec. 6.4.4 reports as the rate; ``ratio`` the largest difference at a point.
    """
    largest, smallest = eigenvalues[:, -1], eigenvalues[:, 0]
    return {
        "rate": max_score(largest, "1/s", note),
        "mean_rate": mean_score(largest, "1/s", note),
        "ratio": max_score(largest - smallest, "1/s", note),
        "non_contracting_fraction": share_score(largest >= 0, note),
    }


def _numbers(eigenvalues: Eigenvalues) -> Float[np.ndarray, "point D"]:
    return eigenvalues.detach().double().numpy()
