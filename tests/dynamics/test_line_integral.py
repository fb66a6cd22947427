"""The field of Eq. (5.1), (5.2): closed forms, identities for all parameters, and rates of convergence."""

import math
from itertools import pairwise

import pytest
import torch
from torch import nn
from torch.func import jacrev, vmap
from torch.testing import assert_close

from geomotion.dynamics.line_integral import DormandPrince, LineIntegralField, RungeKutta4
from geomotion.dynamics.quadrature import GaussLegendre
from geomotion.dynamics.regularisers import (
    ConstantRegulariser,
    EigenvalueRegulariser,
    StateDependentRegulariser,
    StateIndependentRegulariser,
)
from geomotion.networks.mlp import MLP, JacobianRoot, SkewMatrix

EPSILON = 0.05
BATCHES = [(), (3,), (2, 3)]


class PolynomialRoot(nn.Module):
    """J_θ(x) = C + x_0 E, so that the integrand of Eq. (5.2) is a quadratic polynomial in t."""

    def __init__(self, constant: torch.Tensor, slope: torch.Tensor) -> None:
        super().__init__()
        self.constant, self.slope = constant, slope

    def forward(self, x):
        return self.constant + x[..., :1, None] * self.slope


def random_field(
    dim: int, seed: int = 0, integrator=None, gain: float = 2.0, regulariser=None, skew: bool = False
) -> LineIntegralField:
    """A random tanh network with weights `gain` times the usual ones, in double precision."""
    torch.manual_seed(seed)
    root = JacobianRoot(dim, [24, 24])
    skew_part = SkewMatrix(dim, [24]) if skew else None
    with torch.no_grad():
        for parameter in (*root.parameters(), *(skew_part.parameters() if skew_part else ())):
            parameter.mul_(gain)
    regulariser = regulariser or ConstantRegulariser(EPSILON, dim)
    base_point, base_velocity = torch.randn(dim), nn.Parameter(torch.randn(dim))
    integrator = integrator or GaussLegendre(40)
    return LineIntegralField(root, regulariser, base_point, base_velocity, integrator, skew_part).double()


def with_integrator(field: LineIntegralField, integrator) -> LineIntegralField:
    parts = (field.jacobian_root, field.regulariser, field.base_point, field.base_velocity)
    return LineIntegralField(*parts, integrator, field.skew_part).double()


def symmetric_part(matrix: torch.Tensor) -> torch.Tensor:
    return (matrix + matrix.mT) / 2


def states(*shape: int, seed: int = 1) -> torch.Tensor:
    return 2 * torch.randn(*shape, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))


def true_jacobian(field: LineIntegralField, x: torch.Tensor) -> torch.Tensor:
    return vmap(jacrev(field))(x)


# ---------------------------------------------------------------- closed forms
@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("dim", [1, 2, 4])
def test_constant_jacobian_gives_the_affine_field_and_is_its_jacobian(dim, batch):
    constant = states(dim, dim, seed=2)
    root = PolynomialRoot(constant, torch.zeros_like(constant))
    base_point, base_velocity = states(dim, seed=3), states(dim, seed=4)
    regulariser = ConstantRegulariser(EPSILON, dim).double()
    field = LineIntegralField(root, regulariser, base_point, base_velocity, GaussLegendre(1).double())
    jacobian = -(constant.T @ constant + regulariser.epsilon.diag())
    x = states(*batch, dim)
    assert_close(field(x), base_velocity + (x - base_point) @ jacobian.T)
    assert_close(field.contraction_jacobian(x), jacobian.expand(*batch, dim, dim))
    assert_close(true_jacobian(field, x.reshape(-1, dim)), jacobian.expand(math.prod(batch), dim, dim))


def test_two_nodes_are_exact_where_the_integrand_is_quadratic_and_one_is_not():
    root = PolynomialRoot(states(2, 2, seed=2), states(2, 2, seed=3))
    regulariser = ConstantRegulariser(EPSILON, 2).double()
    field = LineIntegralField(root, regulariser, states(2, seed=4), states(2, seed=5), GaussLegendre(2).double())
    x = states(6, 2)
    assert_close(field(x), with_integrator(field, GaussLegendre(9))(x), rtol=1e-12, atol=1e-12)
    assert (field(x) - with_integrator(field, GaussLegendre(1))(x)).abs().max() > 0.1


@pytest.mark.parametrize("seed", range(3))
def test_in_one_dimension_the_contraction_jacobian_is_the_derivative(seed):
    field = random_field(1, seed)
    x = states(20, 1)
    assert_close(true_jacobian(field, x), field.contraction_jacobian(x), rtol=1e-9, atol=1e-9)


# ---------------------------------------------------------------- identities for all parameters
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("dim", [1, 2, 5])
def test_contraction_jacobian_is_symmetric_and_at_most_minus_epsilon(dim, seed):
    jacobian = random_field(dim, seed, gain=3.0).contraction_jacobian(states(50, dim))
    assert_close(jacobian, jacobian.mT)
    assert torch.linalg.eigvalsh(jacobian).max() <= -EPSILON + 1e-8  # ε was given in single precision


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("dim", [2, 3, 5])
def test_the_skew_part_leaves_the_symmetric_part_and_every_quadratic_form_alone(dim, seed):
    field = random_field(dim, seed, gain=3.0, skew=True)
    x, v = states(50, dim), states(50, dim, seed=2).unsqueeze(-1)
    jacobian = field.contraction_jacobian(x)
    field.skew_part = None
    without = field.contraction_jacobian(x)
    assert (jacobian - jacobian.mT).abs().max() > 0.1
    assert_close(symmetric_part(jacobian), without)
    assert_close(v.mT @ jacobian @ v, v.mT @ without @ v)
    assert torch.linalg.eigvalsh(symmetric_part(jacobian)).max() <= -EPSILON + 1e-8


@pytest.mark.parametrize("skew", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_a_network_of_epsilon_bounds_the_symmetric_part_at_every_state(seed, skew):
    torch.manual_seed(seed)
    field = random_field(3, seed, regulariser=StateDependentRegulariser(MLP(3, 3, [16]), 1e-3, 10.0), skew=skew)
    x = states(50, 3)
    largest = torch.linalg.eigvalsh(symmetric_part(field.contraction_jacobian(x)))[:, -1]
    smallest_epsilon = field.regulariser(x).amin(-1)
    assert (largest <= -smallest_epsilon + 1e-10).all()
    assert smallest_epsilon.std() > 0


@pytest.mark.parametrize("skew", [False, True])
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("dim", [2, 5])
def test_the_field_pulls_every_state_towards_the_base_point(dim, seed, skew):
    # Positive weights make the inequality exact for any number of nodes.
    field = random_field(dim, seed, GaussLegendre(5), gain=3.0, skew=skew)
    offset = states(200, dim)
    change = field(field.base_point + offset) - field(field.base_point)
    squared = offset.square().sum(-1)
    assert ((offset * change).sum(-1) <= -EPSILON * squared + 1e-7 * squared).all()


def test_the_velocity_at_the_base_point_is_the_base_velocity():
    field = random_field(3)
    assert_close(field(field.base_point), field.base_velocity)


def test_a_vector_epsilon_bounds_each_axis():
    field = random_field(2, regulariser=StateIndependentRegulariser(0.1, 2, 1e-3, 10.0))
    jacobian = field.contraction_jacobian(states(5, 2))
    root = field.jacobian_root(states(5, 2))
    assert_close(-jacobian - root.mT @ root, field.regulariser.epsilon.diag().expand(5, 2, 2))


def test_a_constant_skew_part_adds_its_linear_field():
    field, x = random_field(3, skew=True), states(5, 3)
    field.skew_part.network.double().start_at(states(3, seed=7))
    skew = field.skew_part(field.base_point)
    velocity = field(x)
    field.skew_part = None
    assert_close(velocity - field(x), (x - field.base_point) @ skew.T)


def test_regularisation_of_eigenvalues_reaches_the_network_and_not_the_skew_part():
    field = random_field(2, gain=1.0, regulariser=EigenvalueRegulariser(EPSILON, 2, 1.0, 10.0), skew=True)
    loss = field.regularisation(states(20, 2))
    loss.backward()
    assert loss < 0
    assert all(parameter.grad.abs().max() > 0 for parameter in field.jacobian_root.parameters())
    assert all(parameter.grad.abs().max() < 1e-12 for parameter in field.skew_part.parameters())


# ---------------------------------------------------------------- what does not hold
def test_in_two_dimensions_the_contraction_jacobian_is_not_the_jacobian_of_the_field():
    # The rows of a network's Ĵ are no gradients. The thesis concludes from Eq. (5.1), (5.2) that the field contracts;
    # the true Jacobian of these random fields has eigenvalues of both signs, and some pairs of trajectories part.
    axis = torch.linspace(-3, 3, 20, dtype=torch.float64)
    grid = torch.cartesian_prod(axis, axis)
    shares = []
    for seed in range(3):
        field = random_field(2, seed)
        jacobian = true_jacobian(field, grid).detach()
        symmetric = (jacobian + jacobian.mT) / 2
        assert torch.linalg.eigvalsh(field.contraction_jacobian(grid)).max() < 0
        shares.append((torch.linalg.eigvalsh(symmetric)[:, -1] > 0).double().mean().item())
    assert min(shares) > 0.05


# ---------------------------------------------------------------- integrators
def _errors(field: LineIntegralField, integrators, x: torch.Tensor) -> list[float]:
    exact = with_integrator(field, GaussLegendre(80))(x)
    return [(with_integrator(field, integrator)(x) - exact).abs().max().item() for integrator in integrators]


def test_quadrature_converges_geometrically_on_a_smooth_network():
    errors = _errors(random_field(2, gain=1.5), [GaussLegendre(count) for count in range(8, 41, 8)], states(20, 2))
    digits_per_eight_nodes = [math.log10(coarse / fine) for coarse, fine in pairwise(errors)]
    assert digits_per_eight_nodes == pytest.approx([2.6] * 4, abs=0.5)


def test_runge_kutta_converges_with_order_four():
    steps = [16, 32, 64]
    errors = _errors(random_field(2, gain=1.0), [RungeKutta4(count) for count in steps], states(20, 2))
    slopes = [math.log2(coarse / fine) for coarse, fine in pairwise(errors)]
    assert slopes == pytest.approx([4.0, 4.0], abs=0.3)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
def test_dormand_prince_stays_near_its_tolerance(tolerance):
    field, x = random_field(2), states(20, 2)
    (error,) = _errors(field, [DormandPrince(tolerance, tolerance)], x)
    assert error <= 10 * tolerance * (1 + field(x).abs().max().item())


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize(("dim", "skew"), [(1, False), (2, True), (8, False), (8, True)])
def test_integrators_agree_for_any_batch(dim, skew, batch):
    field, x = random_field(dim, gain=1.0, skew=skew), states(*batch, dim)
    for integrator in (RungeKutta4(100), DormandPrince(1e-9, 1e-9)):
        assert_close(with_integrator(field, integrator)(x), field(x), rtol=1e-6, atol=1e-6)


def test_integrators_agree_on_the_gradient_of_every_parameter():
    regulariser = StateIndependentRegulariser(0.1, 2, 1e-3, 10.0)
    field, x = random_field(2, gain=1.0, regulariser=regulariser), states(10, 2)
    reference = with_integrator(field, RungeKutta4(100))
    gradients = [torch.autograd.grad(f(x).square().sum(), list(f.parameters())) for f in (field, reference)]
    for found, expected in zip(*gradients, strict=True):
        assert_close(found, expected, rtol=1e-4, atol=1e-5)


# ---------------------------------------------------------------- parameters
def test_parameters_are_learned_and_tensors_are_fixed():
    root, regulariser = JacobianRoot(2, [4]), ConstantRegulariser(EPSILON, 2)
    field = LineIntegralField(root, regulariser, nn.Parameter(torch.ones(2)), torch.zeros(2), GaussLegendre(3))
    learned = {name for name, _ in field.named_parameters()}
    assert "base_point" in learned
    assert "base_velocity" not in learned
    assert {"base_point", "base_velocity"} <= field.state_dict().keys()
    field(torch.zeros(2)).sum().backward()
    assert field.base_point.grad.abs().min() > 0
