"""Bounds on the true Jacobian of a line-integral field over boxes, from those on its networks."""

import copy

import torch

from geomotion.dynamics.balls import ROUND_OFF, Ball, linear
from geomotion.dynamics.line_integral import LineIntegralField
from geomotion.dynamics.quadrature import GaussLegendre
from geomotion.dynamics.regularisers import (
    SMALLEST_EPSILON,
    ConstantRegulariser,
    Regulariser,
    StateDependentRegulariser,
    StateIndependentRegulariser,
)
from geomotion.networks.jets import BOUNDED, Jet, Radii, enclose, pair_numbers
from geomotion.networks.mlp import ACTIVATIONS, MLP, JacobianRoot, SkewMatrix
from geomotion.scores.verification import JacobianEnclosure
from geomotion.types import States

SQUARE_ERROR = 4 * ROUND_OFF  # of a learned ε, relative


def why_unbounded(field: object) -> str:
    """Why :class:`LineIntegralBounds` cannot serve a field; empty if it can."""
    if not isinstance(field, LineIntegralField):
        return "bounds are known for field=line_integral only"
    if not isinstance(field.integrator, GaussLegendre):
        return "bounds need field.integrator=quadrature"
    if not (isinstance(field.jacobian_root, JacobianRoot) and isinstance(field.skew_part, SkewMatrix | None)):
        return "bounds are known for perceptrons only"
    unknown = {type(part).__name__ for part in field.modules() if type(part) in ACTIVATIONS.values()} - BOUNDED
    return f"bounds on {', '.join(sorted(unknown))} are not known" if unknown else ""


class LineIntegralBounds:
    r"""The Jacobian of the field as it is computed, by quadrature in exact arithmetic.

    With c_q = x_0 + t_q (x - x_0) and d = x - x_0,

    .. math::
        \partial_j f_i &= \sum_q w_q \left(\hat J_{ij} + t_q \textstyle\sum_k \partial_j \hat J_{ik} d_k\right)(c_q) \\
        \partial_l \partial_j f_i &= \sum_q w_q \left(t_q (\partial_l \hat J_{ij} + \partial_j \hat J_{il})
            + t_q^2 \textstyle\sum_k \partial_j \partial_l \hat J_{ik} d_k\right)(c_q)

    Args:
        field: A field of which :func:`why_unbounded` says nothing.
    """

    def __init__(self, field: object) -> None:
        assert isinstance(field, LineIntegralField)
        assert not why_unbounded(field)
        exact = copy.deepcopy(field).double().requires_grad_(False)
        root, integrator, skew = exact.jacobian_root, exact.integrator, exact.skew_part
        assert isinstance(root, JacobianRoot)
        assert isinstance(integrator, GaussLegendre)
        assert isinstance(skew, SkewMatrix | None)
        self.dim, self.base_point, self.regulariser = exact.dim, exact.base_point, exact.regulariser
        self.root, self.integrator, self.skew = root.network, integrator, skew
        self.pairs = pair_numbers(field.dim)

    def __call__(self, centres: States, radii: States) -> JacobianEnclosure:
        """Enclose ∂f/∂x at the centres of boxes, and its derivatives over the boxes."""
        t, weights = Ball.exact(self.integrator.nodes), Ball.exact(self.integrator.weights[:, None, None])
        base = Ball.exact(self.base_point)
        direction = Ball.exact(centres) - base
        nodes = base + t[:, None] * direction[:, None]
        point, box = self._contraction_jacobian(nodes, t.mid[:, None] * radii[:, None])
        at_centre = weights * self._jacobian(point, direction, t)
        slope = weights[..., None] * self._slope(box, direction.enlarged(radii), t)
        return JacobianEnclosure(at_centre.sum(1), slope.sum(1))

    def _jacobian(self, matrix: Jet, direction: Ball, t: Ball) -> Ball:
        """The sum's terms in the first formula, shape (cell, node, i, j)."""
        change = (matrix.first * direction[:, None, None, None]).sum(-1)
        return matrix.value + t[:, None, None] * change.mT

    def _slope(self, matrix: Jet, direction: Ball, t: Ball) -> Ball:
        """The sum's terms in the second formula, shape (cell, node, l, i, j)."""
        t = t[:, None, None, None]
        change = (matrix.second * direction[:, None, None, None]).sum(-1)[..., self.pairs, :].mT
        return t * (matrix.first + matrix.first.transpose(-1, -3) + t * change)

    def _contraction_jacobian(self, centre: Ball, radii: Radii) -> tuple[Jet, Jet]:
        """Ĵ at the centres and over the boxes, its outputs shaped (i, k)."""
        square = (self.dim, self.dim)
        roots = enclose(self.root, centre, radii)
        point, box = (-_gram(root.mapped(lambda part: part.unflatten(-1, square))) for root in roots)
        diagonals = _epsilon(self.regulariser, centre, radii)
        point, box = (one + -each.mapped(Ball.diagonal) for one, each in zip((point, box), diagonals, strict=True))
        if self.skew is None:
            return point, box
        basis = self.skew.basis.T
        skew = [
            one.mapped(lambda part: linear(basis, part).unflatten(-1, square))
            for one in enclose(self.skew.network, centre, radii)
        ]
        return point + skew[0], box + skew[1]


def _gram(root: Jet) -> Jet:
    """RᵀR of a matrix R."""
    rows, columns = torch.triu_indices(*root.first.mid.shape[-3:-2] * 2)
    value = root.value[..., None, :, :]
    first = root.first.mT @ value
    second = root.second.mT @ value + root.first[..., rows, :, :].mT @ root.first[..., columns, :, :]
    return Jet(root.value.mT @ root.value, first + first.mT, second + second.mT)


def _epsilon(regulariser: Regulariser, centre: Ball, radii: Radii) -> tuple[Jet, Jet]:
    """ε at the centres and over the boxes."""
    match regulariser:
        case StateDependentRegulariser(epsilon_root=MLP() as network):
            point, box = (_square(root) for root in enclose(network, centre, radii))
            return point, box
        case ConstantRegulariser() | StateIndependentRegulariser():
            epsilon = Ball.exact(regulariser.epsilon).enlarged(SQUARE_ERROR * regulariser.epsilon)
            none = Ball.exact(torch.zeros(1, len(regulariser.epsilon), dtype=torch.float64))
            return (Jet(epsilon, none, none),) * 2
        case unknown:
            raise TypeError(f"no bounds on {type(unknown).__name__}")


def _square(root: Jet) -> Jet:
    """The squares of a function's outputs and the smallest ε."""
    two = Ball.exact(torch.full_like(root.value.mid, 2.0))
    smallest = Ball.exact(torch.tensor(SMALLEST_EPSILON, dtype=torch.float64))
    return root.composed(root.value * root.value + smallest, two * root.value, two)
