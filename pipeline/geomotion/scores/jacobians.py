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

    .. math:: \tfrac12 (M J + J^\top M + \dot M)\, v = \lambda M v, \qquad M = D\psi^\top D\psi

    The result equals :func:`symmetric_eigenvalues` of the latent field's Jacobian where there is a latent field;
    this form also serves fields that were changed in the robot's coordinates. It is slower, because it needs second
    derivatives of the chart.

    Returns:
        Generalised eigenvalues, ascending [1/s for a field in units per second].

    Source:
        Thesis Eq. (2.15).
    """
    jacobians = field_jacobian(field, x)
    velocities = field(x).detach()
    chart_jacobian, chart_jacobian_rate = jvp(lambda y: _forward_jacobian(chart.to_latent, y), (x,), (velocities,))[:2]
    metric = chart_jacobian.mT @ chart_jacobian
    # sym(MJ) + Ṁ/2 is the symmetric part of MJ + Dψᵀ d/dt Dψ
    form = metric @ jacobians + chart_jacobian.mT @ chart_jacobian_rate
    inverse_root = torch.linalg.inv(torch.linalg.cholesky(metric))
    return symmetric_eigenvalues(inverse_root @ form @ inverse_root.mT).detach()


def _forward_jacobian(function: Map, x: States) -> Jacobians:
    """As :func:`field_jacobian`, by forward differentiation, which can be differentiated again."""
    axes = torch.eye(x.shape[1], dtype=x.dtype, device=x.device)
    return torch.stack([jvp(function, (x,), (axis.expand_as(x),))[1] for axis in axes], dim=2)
