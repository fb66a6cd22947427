"""Length and energy of latent curves, and geodesics by gradient descent on the energy."""

from collections.abc import Callable
from dataclasses import dataclass

import torch

from geomotion.types import Float, Tensor

Embedding = Callable[[Tensor], Tensor]
"""Latent points (*batch, d) → points of a Euclidean space whose metric is pulled back."""


def straight_line(
    start: Float[Tensor, " d"], goal: Float[Tensor, " d"], points: int
) -> Float[Tensor, "point d"]:  # fmt: skip
    """The geodesic of the Euclidean metric."""
    share = torch.linspace(0, 1, points, dtype=start.dtype, device=start.device)[:, None]
    return start + share * (goal - start)


def chord_lengths(embedded: Float[Tensor, "*batch point m"]) -> Float[Tensor, "*batch point-1"]:
    """Lengths of the pieces of a curve in the space that its metric is pulled back from.

    A chord is never longer than the piece of curve it spans, and their sum converges to the length (2.3) to second
    order.
    """
    lengths: Tensor = torch.linalg.vector_norm(embedded.diff(dim=-2), dim=-1)
    return lengths


def curve_length(embedded: Float[Tensor, "*batch point m"]) -> Float[Tensor, "*batch"]:
    """Riemannian length by chords.

    Source: Thesis Eq. (2.2), (2.3), (3.14).
    """
    return chord_lengths(embedded).sum(dim=-1)


def curve_energy(
    embedded: Float[Tensor, "*batch point m"], stretch: Float[Tensor, "*batch point"] | None = None
) -> Float[Tensor, "*batch"]:
    """∫ f² ⟨ċ, M ċ⟩ dt over t in [0, 1], the points taken as evenly spaced in t.

    At least the squared length, and equal to it at constant speed.

    Args:
        embedded: Points in the space that M is pulled back from.
        stretch: Conformal factor f there; 1 if omitted.
    """
    squares = embedded.diff(dim=-2).square().sum(dim=-1)
    if stretch is not None:
        squares = squares * ((stretch[..., 1:] + stretch[..., :-1]) / 2).square()
    return squares.sum(dim=-1) * (embedded.shape[-2] - 1)


@dataclass(frozen=True)
class Descent:
    """A curve found by gradient descent.

    Attributes:
        coefficients: Of the spline with the lowest energy, shape (knot, d).
        energies: Energy before each step and after the last.
    """

    coefficients: Float[Tensor, "knot d"]
    energies: list[float]


def descend(
    embedding: Embedding,
    basis: Float[Tensor, "point knot"],
    coefficients: Float[Tensor, "knot d"],
    steps: int,
    learning_rate: float = 0.01,
    conformal: Embedding | None = None,
) -> Descent:
    """Minimise the energy of a spline over its inner coefficients; the end points stay.

    Args:
        embedding: Map whose Euclidean metric is pulled back.
        basis: Values of the spline's basis functions at its points.
        coefficients: Where to start: from a graph path, or from a straight line, which can get stuck behind a wall.
        steps: Of Adam on the logarithm of the energy, whose scale then does not matter.
        learning_rate: Relative to the extent of the coefficients.
        conformal: Factor f; 1 if omitted.

    Source: Thesis Eq. (3.14), Sec. 3.5.4.
    """
    inner = coefficients[1:-1].clone().requires_grad_(True)
    extent = float((coefficients.amax(dim=0) - coefficients.amin(dim=0)).max())
    optimiser = torch.optim.Adam([inner], learning_rate * extent)
    best, energies = coefficients, []
    for step in range(steps + 1):
        full = torch.cat([coefficients[:1], inner, coefficients[-1:]])
        points = basis @ full
        energy = curve_energy(embedding(points), None if conformal is None else conformal(points))
        energies.append(float(energy.detach()))
        if energies[-1] <= min(energies):
            best = full.detach()
        if step < steps:
            optimiser.zero_grad()
            energy.log().backward()  # type: ignore[no-untyped-call]
            optimiser.step()
    return Descent(best, energies)
