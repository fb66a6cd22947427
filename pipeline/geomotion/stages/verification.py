"""The attempt to prove, on the box around the demonstrations, what a field's construction does not."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from geomotion.config import EvaluationConfig
from geomotion.dynamics.certificate import ON_MANIFOLD, Claim
from geomotion.dynamics.charts import ComposedChart, IdentityChart
from geomotion.dynamics.fields import ChartedField
from geomotion.networks.line_integral_bounds import LineIntegralBounds, why_unbounded
from geomotion.scores.evaluation import Evaluation
from geomotion.scores.grids import Box, bounding_box
from geomotion.scores.score import Score
from geomotion.scores.verification import Verification, verify_contraction

MOST_AXES = 3  # the number of cells grows with its power
REASON = (
    "The symmetric part of the true Jacobian is proven to be at most -τI everywhere in a box around the "
    "demonstrations, by interval arithmetic through the network and the quadrature on {cells} cells, rounding "
    "included. Two trajectories approach each other at that rate as long as both are in the box; that they stay there "
    "is not proven."
)


@dataclass(frozen=True)
class Attempt:
    """What bisection found out about a field.

    Attributes:
        field: The field.
        box: Where, in the chart's coordinates.
        found: The result, in the latent field's unit of time.
    """

    field: ChartedField
    box: Box
    found: Verification

    def evaluation(self) -> Evaluation:
        """Shares of the box, the proven rate, and the state that disproves contraction, where there are any."""
        found, per_s = self.found, 1 / self.field.time_unit_s
        note = f"interval arithmetic on {found.cells} cells of the box around the demonstrations"
        shares = {
            "contracting": found.contracting,
            "not_contracting": found.not_contracting,
            "undecided": found.undecided,
        }
        scores = {
            f"verification.{name}": Score(share, "1", found.cells, statistic="share", note=f"of its volume; {note}")
            for name, share in shares.items()
        }
        if found.rate is not None:
            scores["verification.rate"] = Score(-found.rate * per_s, "1/s", statistic="upper bound", note=note)
        witness = np.empty(0)
        if found.witness is not None and found.witness_eigenvalue is not None:
            witness = self._ambient(found.witness)
            place = f"lower bound at {np.array2string(witness, precision=4)} m"
            scores["verification.witness"] = Score(
                found.witness_eigenvalue * per_s, "1/s", statistic="lower bound", note=f"{place}; {note}"
            )
        return Evaluation(scores, {"verification_witness": witness})

    def amended(self, certificate: Mapping[str, Any]) -> dict[str, Any]:
        """The certificate with the claim that was proven; as it was if none was."""
        if self.found.rate is None:
            return dict(certificate)
        return dict(certificate) | {
            "claim": Claim.verified_on_set.value,
            "rate_per_s": self.found.rate / self.field.time_unit_s,
            "reason": REASON.format(cells=self.found.cells) + ("" if self.field.is_onto else ON_MANIFOLD),
            "verified_set": self._corners(),
        }

    def _corners(self) -> dict[str, list[float]]:
        corners = {"lower": self.box.lower, "upper": self.box.upper}
        if isinstance(self.field.chart, ComposedChart) and isinstance(self.field.chart.outer, IdentityChart):
            return {f"{name}_m": self._ambient(corner).tolist() for name, corner in corners.items()}
        return {name: corner.tolist() for name, corner in corners.items()}

    @torch.no_grad()
    def _ambient(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        dtype = next(self.field.parameters()).dtype
        return self.field.chart.to_ambient(torch.as_tensor(z, dtype=dtype)[None])[0].double().numpy()


def prove(
    certificate: Mapping[str, Any], field: ChartedField, states: NDArray[np.float64], settings: EvaluationConfig
) -> tuple[Evaluation, dict[str, Any]]:
    """What was proven of a field that does not contract by construction, and the certificate that follows from it.

    Args:
        certificate: What is known from training.
        field: The field.
        states: Demonstrated states [m].
        settings: Budget of cells, and the margin of the box.
    """
    if certificate["claim"] != Claim.measured_only.value:
        return Evaluation(), dict(certificate)
    tried = attempt(field, states, settings.grid_margin, settings.verify_cells)
    if isinstance(tried, str):
        return Evaluation(omitted={"verification": tried}), dict(certificate)
    return tried.evaluation(), tried.amended(certificate)


@torch.no_grad()
def attempt(field: ChartedField, states: NDArray[np.float64], margin: float, cells: int) -> Attempt | str:
    """Try to prove that a field contracts around demonstrations, in the Euclidean metric of its chart's coordinates.

    Args:
        field: The field.
        states: Demonstrated states [m].
        margin: By how much the box around them is larger on each side, in shares of its extent.
        cells: Budget of :func:`verify_contraction`.

    Returns:
        What was found; or why nothing was tried.
    """
    if cells == 0:
        return "evaluation.verify_cells is 0"
    if reason := why_unbounded(field.field):
        return reason
    if field.field.dim > MOST_AXES:
        return f"boxes of more than {MOST_AXES} dimensions have too many cells"
    dtype = next(field.parameters()).dtype
    latent = field.chart.to_latent(torch.as_tensor(states, dtype=dtype)).double().numpy()
    box = bounding_box([latent]).enlarged(margin)
    return Attempt(field, box, verify_contraction(LineIntegralBounds(field.field), box, cells))
