"""Losses that fields are fitted with."""

import torch

from geomotion.config import VelocityTraining
from geomotion.dynamics.conditional import ConditionalLineIntegral
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.line_integral import LineIntegralField
from geomotion.scores.jacobians import field_jacobian, symmetric_eigenvalues
from geomotion.training.data import Geometry, Surroundings, TrainingSet
from geomotion.training.trainer import Losses
from geomotion.types import Float, States, Tensor


class VelocityReconstruction:
    """Mean squared velocity error, Eq. (5.3), in units of the data's size and duration.

    A line-integral field adds its regulariser's loss and, with `curl_weight` or `contraction_weight` above 0,
    :func:`curl_penalty` or :func:`contraction_penalty` on states drawn from the box around the demonstrations,
    enlarged by `curl_margin`.

    Args:
        data: Demonstrated states and velocities.
        geometry: Their size and duration, which make the loss free of units.
        settings: Weights and sample sizes.
    """

    def __init__(self, data: TrainingSet, geometry: Geometry, settings: VelocityTraining) -> None:
        self.settings = settings
        self.states = data.all_states
        self.times_s = torch.cat(data.times)[:, None]
        self.velocities = data.all_velocities
        self.batch_points = min(settings.batch_points, len(self.states))
        self.speed_m_per_s = geometry.scale_m / geometry.duration_s
        self.surroundings = Surroundings(data, settings.curl_margin, geometry.context)

    def __call__(self, model: ChartedField, progress: float, generator: torch.Generator) -> Losses:
        chosen = torch.randint(len(self.states), (self.batch_points,), generator=generator)
        states = self.states[chosen]
        error = (model.velocity(states, self.times_s[chosen]) - self.velocities[chosen]) / self.speed_m_per_s
        losses = {"velocity": error.square().sum(-1).mean()}
        if isinstance(model.field, LineIntegralField | ConditionalLineIntegral):
            field, latent = _line_integral_at(model.field, _latent(model, states))
            losses["regulariser"] = field.regularisation(latent)
            losses |= self._penalties(model, model.field, generator)
        return losses

    def _penalties(
        self, model: ChartedField, field: LineIntegralField | ConditionalLineIntegral, generator: torch.Generator
    ) -> Losses:
        settings, losses = self.settings, {}
        if settings.curl_weight > 0 or settings.contraction_weight > 0:
            anywhere = _line_integral_at(field, _latent(model, self.surroundings.draw(settings.curl_points, generator)))
        if settings.curl_weight > 0:
            losses["curl"] = settings.curl_weight * curl_penalty(*anywhere)
        if settings.contraction_weight > 0:
            missing = contraction_penalty(*anywhere, settings.contraction_reserve_per_duration)
            losses["contraction"] = settings.contraction_weight * missing
        return losses


def _line_integral_at(
    field: LineIntegralField | ConditionalLineIntegral, latent: States
) -> tuple[LineIntegralField, States]:
    """The field under the conditions that the states carry, if they do, and the states without them."""
    if isinstance(field, LineIntegralField):
        return field, latent
    return field.given(latent[:, -field.context :]), latent[:, : -field.context]


def curl_penalty(field: LineIntegralField, x: States) -> Float[Tensor, ""]:
    r"""How far Ĵ is from being the Jacobian of the field, mean over states.

    .. math:: \operatorname{mean}_x \left\| \partial f / \partial x - \hat J(x) \right\|_F^2

    Zero where the rows of Ĵ are gradients, that is where their curl vanishes; only there Ĵ ≼ -ε I makes f contract.
    """
    gap = field_jacobian(field, x, differentiable=True) - field.contraction_jacobian(x)
    return gap.square().sum((-2, -1)).mean()


def contraction_penalty(field: LineIntegralField, x: States, reserve: float) -> Float[Tensor, ""]:
    r"""How much contraction is missing, mean over states.

    .. math:: \operatorname{mean}_x \max(0,\ \lambda_{\max}(\operatorname{sym} \partial f / \partial x) + r)^2

    Args:
        field: f.
        x: States.
        reserve: r, the rate from which on nothing is missing [1/time].
    """
    largest = symmetric_eigenvalues(field_jacobian(field, x, differentiable=True))[:, -1]
    return (largest + reserve).clamp(min=0).square().mean()


@torch.no_grad()
def _latent(model: ChartedField, states: States) -> States:
    """Where the field sees these states; penalties shape the field there and not the chart."""
    return model.chart.to_latent(states)
