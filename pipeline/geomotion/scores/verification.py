"""Proof that a field contracts on a box, by bisection with bounds on its Jacobian."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int

from geomotion.dynamics.balls import ROUND_OFF, Ball
from geomotion.scores.grids import Box
from geomotion.types import States, Tensor

CELLS_AT_ONCE = 32
FIRST_CELLS_PER_AXIS = 8
EIGENVALUE_ERROR = 100 * ROUND_OFF  # of the computed eigenvalues of a small symmetric matrix, relative to its norm
OVERLAP = 1e-12  # of neighbouring cells, relative to the box: more than what rounding could leave between them
SHARE_BUDGET = 0.2
SETTLED_SHARE = 0.5  # a cell is cut no further once its bound is this share of the rate at its centre


@dataclass(frozen=True)
class JacobianEnclosure:
    """∂f/∂x in cells: x ↦ centre + Σ_l slope_l (x - x_c)_l with any slope from the ball.

    Attributes:
        at_centre: Shape (cell, D, D).
        slope: Derivatives by each coordinate l anywhere in the cell, shape (cell, l, D, D).
    """

    at_centre: Ball
    slope: Ball


JacobianBounds = Callable[[States, States], JacobianEnclosure]
"""Encloses ∂f/∂x in cells, given by their centres and half their sides, both of shape (cell, D)."""


@dataclass(frozen=True)
class Cells:
    """Boxes that tile a box, with what is known about λ_max in each.

    Attributes:
        centres: Shape (cell, D).
        radii: Half the sides, a little more than needed to tile without gaps, shape (cell, D).
        shares: Of the whole volume.
        lower: Lower bound on λ_max.
        upper: Upper bound on λ_max.
    """

    centres: States
    radii: States
    shares: Float[Tensor, " cell"]
    lower: Float[Tensor, " cell"]
    upper: Float[Tensor, " cell"]

    def __getitem__(self, index: Any) -> "Cells":
        return Cells(*(part[index] for part in self._parts()))

    def split(self, count: int) -> tuple["Cells", "Cells"]:
        """The first ones and the others."""
        return self[:count], self[count:]

    def halved(self, axes: Int[Tensor, " cell"]) -> "Cells":
        """Each cell cut in two across one of its axes; both halves keep what is known about it."""
        across = torch.nn.functional.one_hot(axes, self.centres.shape[1]) * self.radii / 2
        return Cells.joined(
            [
                replace(self, centres=self.centres + step, radii=self.radii - across, shares=self.shares / 2)
                for step in (-across, across)
            ]
        )

    @staticmethod
    def joined(cells: Sequence["Cells"]) -> "Cells":
        """All of them, in order."""
        return Cells(*(torch.cat(parts) for parts in zip(*(one._parts() for one in cells), strict=True)))

    def _parts(self) -> tuple[Tensor, ...]:
        return self.centres, self.radii, self.shares, self.lower, self.upper


def first_cells(box: Box) -> Cells:
    """Equal cells, of which nothing is known."""
    extent = torch.from_numpy(box.upper - box.lower).double()
    middles = (torch.arange(FIRST_CELLS_PER_AXIS, dtype=torch.float64) + 0.5) / FIRST_CELLS_PER_AXIS
    shares = torch.cartesian_prod(*[middles] * box.dim).reshape(-1, box.dim)
    centres = torch.from_numpy(box.lower).double() + shares * extent
    radii = (extent / (2 * FIRST_CELLS_PER_AXIS) + OVERLAP * (extent + centres.abs().amax(0))).expand_as(centres)
    unknown = torch.full((len(centres),), torch.inf, dtype=torch.float64)
    return Cells(centres, radii, torch.full_like(unknown, 1 / len(centres)), -unknown, unknown)


@dataclass(frozen=True)
class Verification:
    """What is proven about λ_max(sym ∂f/∂x) on a box.

    Attributes:
        contracting: Share of its volume on which it is proven negative.
        not_contracting: Share on which it is proven positive.
        cells: Number of cells that were looked at.
        rate: -λ_max is proven to be at least this on the whole box; None if that is not proven.
        witness: Of the centres of the cells at which λ_max is proven positive, the one where it is largest; None if
            there is none.
        witness_eigenvalue: What λ_max is at least, there.
    """

    contracting: float
    not_contracting: float
    cells: int
    rate: float | None
    witness: Float[np.ndarray, " D"] | None
    witness_eigenvalue: float | None

    @property
    def undecided(self) -> float:
        """Share of the volume of which nothing is proven."""
        return max(0.0, 1.0 - self.contracting - self.not_contracting)


def verify_contraction(bounds: JacobianBounds, box: Box, budget: int) -> Verification:
    """Cut a box until each cell is known to contract or not to, or the budget is spent; largest cells first.

    A proof for the whole box is out of reach as soon as there is a witness. What remains to be found then are shares,
    and for these `SHARE_BUDGET` of the budget has to do.

    Args:
        bounds: Bounds on the Jacobian.
        box: Where to look.
        budget: Number of cells to look at.
    """
    waiting, settled, looked_at = first_cells(box), [], 0
    witness, most = None, 0.0
    while len(waiting.shares) and looked_at < budget * (1 if witness is None else SHARE_BUDGET):
        cells, waiting = waiting.split(min(CELLS_AT_ONCE, budget - looked_at))
        looked_at += len(cells.shares)
        judged, at_centre, steepness = _judge(cells, bounds(cells.centres, cells.radii))
        if at_centre.max() > most:
            witness, most = cells.centres[at_centre.argmax()].numpy(), float(at_centre.max())
        is_settled = (judged.lower > 0) | (judged.upper < (SETTLED_SHARE * at_centre).clamp(max=0))
        settled.append(judged[is_settled])
        waiting = Cells.joined([waiting, judged[~is_settled].halved(steepness[~is_settled].argmax(-1))])
    return _summarise(Cells.joined([*settled, waiting]), looked_at, witness, most)


def _summarise(cells: Cells, looked_at: int, witness: Float[np.ndarray, " D"] | None, most: float) -> Verification:
    contracting, not_contracting = cells.upper < 0, cells.lower > 0
    return Verification(
        float(cells.shares[contracting].sum()),
        float(cells.shares[not_contracting].sum()),
        looked_at,
        -float(cells.upper.max()) if contracting.all() else None,
        witness,
        most if witness is not None else None,
    )


def _judge(cells: Cells, enclosure: JacobianEnclosure) -> tuple[Cells, Float[Tensor, " cell"], Float[Tensor, "cell D"]]:
    """Bounds on λ_max in cells, a lower bound at their centres, and its change along each axis of a cell.

    λ_max is convex in the matrix, so that of an affine family over a box is largest at a corner; and it is at least
    vᵀSv for any unit vector v, which is affine again. What the slopes differ from their middles is bounded in norm.
    """
    centre, slope = _symmetric(enclosure.at_centre), _symmetric(enclosure.slope)
    radii = cells.radii[..., None, None]
    corners = cells.radii[:, None] * _corners(cells.radii.shape[1])
    matrices = centre.mid[:, None] + torch.einsum("cvl,clij->cvij", corners, slope.mid)
    size = (centre.magnitude + (slope.magnitude * radii).sum(1)).norm(dim=(-2, -1))
    error = EIGENVALUE_ERROR * size + centre.radius.norm(dim=(-2, -1))
    error_in_cell = error + (slope.radius * radii).sum(1).norm(dim=(-2, -1))

    values, vectors = torch.linalg.eigh(centre.mid)
    upper = torch.linalg.eigvalsh(matrices)[..., -1].amax(-1) + error_in_cell
    lower = torch.einsum("ci,cvij,cj->cv", vectors[..., -1], matrices, vectors[..., -1]).amin(-1) - error_in_cell
    judged = replace(cells, lower=torch.maximum(lower, cells.lower), upper=torch.minimum(upper, cells.upper))
    return judged, values[..., -1] - error, (slope.magnitude * radii).norm(dim=(-2, -1))


def _corners(dim: int) -> Float[Tensor, "corner D"]:
    """Corners of the box [-1, 1]^D."""
    ends = torch.tensor([-1.0, 1.0], dtype=torch.float64)
    return torch.cartesian_prod(*[ends] * dim).reshape(-1, dim)


def _symmetric(matrices: Ball) -> Ball:
    return (matrices + matrices.mT) * Ball.exact(torch.full_like(matrices.mid, 0.5))
