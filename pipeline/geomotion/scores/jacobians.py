"""True Jacobians of fields, by automatic differentiation, and the eigenvalues that decide about contraction."""

from collections.abc import Callable
from functools import partial

import torch
from torch.func import jvp

from geomotion.dynamics.fields import Chart
from geomotion.types import Float, States, Tensor

Map = Callable[[Tensor], Tensor]
Jacobians = Float[Tensor, "point D D"]
Eigenvalues = Float[Tensor, "point D"]


def field_jacobian(function: Map, x: States, differentiable: bool = False) -> Jacobians:
    """∂f/∂x at each point, by one backward pass per output over the whole batch.

    Backward passes ask nothing of `function` but to be differentiable, and to treat the rows of a batch
    independently; charts that linearise into a closure are fine.

    Args:
        function: f.
        x: The points.
        differentiable: Whether the result can be differentiated by the parameters of `function`.
    """
    with torch.enable_grad():
        x = x.detach().requires_grad_()
        outputs = function(x).sum(dim=0)
        gradient = partial(torch.autograd.grad, retain_graph=True, create_graph=differentiable, materialize_grads=True)
        rows = [gradient(output, x)[0] for output in outputs]
    return torch.stack(rows, dim=1)


def symmetric_eigenvalues(jacobians: Jacobians) -> Eigenvalues:
    """Eigenvalues of (J + Jᵀ)/2, ascending; all negative: the field contracts there in the Euclidean metric.

    Source:
        Thesis Eq. (2.15), with the identity as metric.
    """
    eigenvalues: Tensor = torch.linalg.eigvalsh((jacobians + jacobians.mT) / 2)
    return eigenvalues


def eigenvalues_in_metric(field: Map, chart: Chart, x: States) -> Eigenvalues:
    r"""Contraction of a field in the metric of a chart, computed in the robot's coordinates.

    .. math:: \tfrac12 (M J + J^\top M + \dot M)\, v = \lambda M v, \qquad M = \Theta^\top \Theta, \quad \Theta = D\psi

    The result equals :func:`symmetric_eigenvalues` of the latent field's Jacobian where there is a latent field;
    this form also serves fields that were changed in the robot's coordinates. It is slower, because it needs second
    derivatives of the chart.

    Returns:
        Generalised eigenvalues, ascending [1/s for a field in units per second].

    Source:
        Thesis Eq. (2.15).
    """
    return symmetric_eigenvalues(generalised_jacobian(field, chart, x)[0])


def generalised_jacobian(field: Map, chart: Chart, x: States) -> tuple[Jacobians, Float[Tensor, " point"]]:
    r"""(Θ̇ + ΘJ) Θ⁻¹ with Θ = Dψ, whose symmetric part has the eigenvalues of :func:`eigenvalues_in_metric`.

    Returns:
        The matrices, and ‖Θ‖ ‖J‖ ‖Θ⁻¹‖ at each point: the terms of the sum are about as large and may cancel, so that
        rounding errors are a small multiple of the relative precision times this.
    """
    jacobians = field_jacobian(field, x)
    velocities = field(x).detach()
    theta, theta_rate = jvp(lambda y: _forward_jacobian(chart.to_latent, y), (x,), (velocities,))[:2]
    inverse = torch.linalg.inv(theta.detach())
    matrices = (theta_rate + theta @ jacobians).detach() @ inverse
    sizes = [part.detach().norm(dim=(-2, -1)) for part in (theta, jacobians, inverse)]
    return matrices, torch.stack(sizes).prod(0)


def _forward_jacobian(function: Map, x: States) -> Jacobians:
    """As :func:`field_jacobian`, by forward differentiation, which can be differentiated again."""
    axes = torch.eye(x.shape[1], dtype=x.dtype, device=x.device)
    return torch.stack([jvp(function, (x,), (axis.expand_as(x),))[1] for axis in axes], dim=2)
