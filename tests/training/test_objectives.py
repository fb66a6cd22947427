"""Velocity reconstruction, Eq. (5.3), and the penalty on the difference between ∂f/∂x and Ĵ."""

import pytest
import torch
from torch import nn
from torch.func import jacrev, vmap
from torch.testing import assert_close

from geomotion import config as schema
from geomotion.dynamics.line_integral import LineIntegralField
from geomotion.dynamics.quadrature import GaussLegendre
from geomotion.dynamics.regularisers import ConstantRegulariser
from geomotion.models import ModelConfig, build
from geomotion.networks.mlp import JacobianRoot, SkewMatrix
from geomotion.training.data import Geometry, TrainingSet
from geomotion.training.objectives import VelocityReconstruction, contraction_penalty, curl_penalty

BOX_LOWER, BOX_UPPER = torch.tensor([-0.1, 0.0]), torch.tensor([0.1, 0.05])


def states(*shape: int, seed: int = 1) -> torch.Tensor:
    return torch.randn(*shape, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))


def field_of(root: nn.Module, dim: int, skew_part: nn.Module | None = None) -> LineIntegralField:
    regulariser = ConstantRegulariser(0.05, dim)
    parts = (torch.full((dim,), 0.3), nn.Parameter(torch.zeros(dim)), GaussLegendre(40))
    return LineIntegralField(root, regulariser, *parts, skew_part).double()


# ---------------------------------------------------------------- the penalty
@pytest.mark.parametrize("skew", [False, True])
def test_a_constant_matrix_has_no_penalty(skew):
    root, skew_part = JacobianRoot(3, [4]), SkewMatrix(3, [4]) if skew else None
    root.network.start_at(torch.randn(9, generator=torch.Generator().manual_seed(0)))
    if skew_part is not None:
        skew_part.network.start_at(torch.tensor([1.0, -2.0, 3.0]))
    assert curl_penalty(field_of(root, 3, skew_part), states(10, 3)) < 1e-24


def test_one_dimension_has_no_penalty():
    torch.manual_seed(0)
    assert curl_penalty(field_of(JacobianRoot(1, [16]), 1), states(10, 1)) < 1e-20


class Separable(nn.Module):
    """A diagonal J_θ, each entry a function of its own coordinate: the rows of Ĵ are gradients."""

    def forward(self, x):
        return torch.diag_embed(1 + x.tanh())


def test_a_matrix_whose_rows_are_gradients_has_no_penalty_and_is_the_jacobian():
    field, x = field_of(Separable(), 3), states(10, 3)
    assert curl_penalty(field, x) < 1e-20
    assert_close(vmap(jacrev(field))(x), field.contraction_jacobian(x))


@pytest.mark.parametrize("skew", [False, True])
def test_the_penalty_is_the_mean_squared_distance_of_the_two_jacobians_and_trains_the_networks(skew):
    torch.manual_seed(0)
    field = field_of(JacobianRoot(2, [16, 16]), 2, SkewMatrix(2, [16]) if skew else None)
    x = states(10, 2)
    penalty = curl_penalty(field, x)
    gap = vmap(jacrev(field))(x) - field.contraction_jacobian(x)
    assert_close(penalty, gap.square().sum() / 10)
    assert penalty > 1e-4

    optimiser = torch.optim.Adam(field.parameters(), lr=3e-3)
    for _ in range(30):
        optimiser.zero_grad()
        curl_penalty(field, x).backward()
        optimiser.step()
    assert curl_penalty(field, x) < 0.5 * penalty
    weights = [parameter for parameter in field.parameters() if parameter.ndim == 2]  # a constant S costs nothing
    assert all(weight.grad.abs().max() > 0 for weight in weights)


@pytest.mark.parametrize("reserve", [0.3, 1.0])
def test_missing_contraction_is_what_the_eigenvalues_exceed_and_training_against_it_removes_it(reserve):
    torch.manual_seed(0)
    root = JacobianRoot(2, [16, 16])
    with torch.no_grad():
        root.network[0].weight.mul_(4)
    field, x = field_of(root, 2), states(40, 2)
    jacobian = vmap(jacrev(field))(x)
    eigenvalues = torch.linalg.eigvalsh((jacobian + jacobian.mT) / 2)[:, -1]
    missing = contraction_penalty(field, x, reserve)
    assert_close(missing, (eigenvalues + reserve).clamp(min=0).square().mean())
    assert missing > 1e-4

    optimiser = torch.optim.Adam(field.parameters(), lr=1e-2)
    for _ in range(40):
        optimiser.zero_grad()
        contraction_penalty(field, x, reserve).backward()
        optimiser.step()
    assert contraction_penalty(field, x, reserve) < 0.1 * missing


# ---------------------------------------------------------------- the objective
@pytest.fixture
def data() -> TrainingSet:
    """Two straight lines across the box."""
    times = torch.linspace(0, 2, 50)
    ends = (BOX_LOWER, BOX_UPPER), (torch.tensor([-0.1, 0.05]), torch.tensor([0.1, 0.0]))
    paths = tuple(start + times[:, None] / 2 * (end - start) for start, end in ends)
    return TrainingSet((times, times), paths, tuple((path[-1] - path[0]).expand_as(path) / 2 for path in paths))


def losses_of(data: TrainingSet, model: ModelConfig, **settings) -> dict[str, torch.Tensor]:
    geometry = Geometry.of(data)
    objective = VelocityReconstruction(data, geometry, schema.VelocityTraining(**settings))
    return dict(objective(build(model, geometry), 0.0, torch.Generator().manual_seed(0)))


INTEGRAL = schema.LineIntegralField(hidden_units=[16])
VANILLA = ModelConfig(schema.IdentityChart(), INTEGRAL, schema.ConstantRegulariser(), 0)


def test_without_weight_there_is_no_penalty_and_with_it_the_other_terms_stay(data):
    without, with_penalty = losses_of(data, VANILLA), losses_of(data, VANILLA, curl_weight=2.0)
    doubled = losses_of(data, VANILLA, curl_weight=4.0)
    assert set(without) == {"velocity", "regulariser"}
    assert_close({name: with_penalty[name] for name in without}, without)
    assert_close(doubled["curl"], 2 * with_penalty["curl"])
    assert with_penalty["curl"] > 0
    both = losses_of(data, VANILLA, curl_weight=2.0, contraction_weight=3.0, contraction_reserve_per_duration=9.0)
    assert set(both) == {"velocity", "regulariser", "curl", "contraction"}
    assert_close({name: both[name] for name in with_penalty}, with_penalty)
    assert both["contraction"] > 0


@pytest.mark.parametrize(
    "regulariser",
    [schema.StateIndependentRegulariser(), schema.StateDependentRegulariser(), schema.EigenvalueRegulariser()],
)
@pytest.mark.parametrize("chart", [schema.IdentityChart(), schema.FlowChart(layers=2)])
def test_every_spread_loss_takes_part(data, chart, regulariser):
    assert losses_of(data, ModelConfig(chart, INTEGRAL, regulariser, 0))["regulariser"] < 0


def test_penalties_leave_the_chart_alone(data):
    geometry = Geometry.of(data)
    model = build(ModelConfig(schema.FlowChart(layers=2), INTEGRAL, schema.EigenvalueRegulariser(), 0), geometry)
    objective = VelocityReconstruction(data, geometry, schema.VelocityTraining(curl_weight=1.0))
    losses = objective(model, 0.0, torch.Generator().manual_seed(0))
    (losses["regulariser"] + losses["curl"]).backward()
    assert all(parameter.grad is None for parameter in model.chart.parameters())
    assert all(parameter.grad is not None for parameter in model.field.jacobian_root.parameters())


def test_penalised_states_fill_the_enlarged_box(data):
    settings = schema.VelocityTraining(curl_points=4000, curl_margin=0.5)
    x = VelocityReconstruction(data, Geometry.of(data), settings).surroundings.draw(
        settings.curl_points, torch.Generator().manual_seed(0)
    )
    extent = BOX_UPPER - BOX_LOWER
    assert_close(x.amin(0), BOX_LOWER - 0.5 * extent, atol=1e-3, rtol=0)
    assert_close(x.amax(0), BOX_UPPER + 0.5 * extent, atol=1e-3, rtol=0)


def test_a_field_without_matrix_has_the_velocity_term_only(data):
    linear = ModelConfig(schema.IdentityChart(), schema.LinearField(), schema.NoRegulariser(), 0)
    assert set(losses_of(data, linear)) == {"velocity"}
