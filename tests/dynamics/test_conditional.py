"""Fields of states and conditions, and the ordinary fields that single conditions give."""

import math

import pytest
import torch
from torch.testing import assert_close

from geomotion.dynamics.charts import AnchoredChart, ComposedChart, ScalingChart
from geomotion.dynamics.conditional import ConditionalLineIntegral, Standing, given
from geomotion.dynamics.conditional_linear import ConditionalLinear
from geomotion.dynamics.embedded import EmbeddedField, RisingClock
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.line_integral import LineIntegralField
from geomotion.dynamics.linear import LinearField
from geomotion.dynamics.potential import PotentialField
from geomotion.dynamics.quadrature import GaussLegendre
from geomotion.dynamics.regularisers import StateDependentRegulariser
from geomotion.dynamics.rollout import rollout
from geomotion.dynamics.time_law import ConditionalTimeLaw
from geomotion.networks.coupling import CouplingFlow
from geomotion.networks.mlp import MLP, JacobianRoot, SkewMatrix
from geomotion.scores.jacobians import eigenvalues_in_metric, field_jacobian

CONTEXT, TIME_UNIT_S, RATE = 2, 2.0, 0.4
FRAME = {"stretch": 0.7, "slowdown": 1.3}  # of a condition


def disturbed(module: torch.nn.Module) -> torch.nn.Module:
    generator = torch.Generator().manual_seed(3)
    with torch.no_grad():
        for parameter in module.parameters():
            parameter.add_(0.2 * torch.randn(parameter.shape, generator=generator).to(parameter))
    return module.double().eval()


def exact(kind: str) -> ChartedField:
    """In a flow whose origin is the goal of every condition."""
    torch.manual_seed(0)
    standing = Standing(PotentialField(2, 8, RATE, 1.0), CONTEXT)
    field = ConditionalLinear(2, CONTEXT, RATE, 1.0) if kind == "linear" else standing
    scaling = ScalingChart(torch.zeros(2 + CONTEXT), 0.1)
    chart = ComposedChart(scaling, CouplingFlow(2, 4, 16, [0.5, 1.0], 1.5, CONTEXT))
    anchored = AnchoredChart(chart, torch.zeros(2 + CONTEXT))
    return disturbed(ChartedField(anchored, field, TIME_UNIT_S, ConditionalTimeLaw(CONTEXT, 6, 0.2)))


@pytest.fixture(params=["linear", "potential"])
def field(request) -> ChartedField:
    return exact(request.param)


@pytest.fixture
def line_integral() -> ConditionalLineIntegral:
    torch.manual_seed(0)
    inner = LineIntegralField(
        JacobianRoot(2, [8], context=CONTEXT),
        StateDependentRegulariser(MLP(2 + CONTEXT, 2, [6]), 1e-3, 10.0),
        torch.tensor([0.1, -0.2]),
        torch.nn.Parameter(torch.tensor([0.3, 0.1])),
        GaussLegendre(8),
        SkewMatrix(2, [8], context=CONTEXT),
    )
    return ConditionalLineIntegral(inner, CONTEXT).double()


def conditions(count: int) -> torch.Tensor:
    """As lengths, as they stand beside states [m]."""
    return 0.1 * torch.randn(count, CONTEXT, generator=torch.Generator().manual_seed(5), dtype=torch.float64)


def states(count: int) -> torch.Tensor:
    return 0.1 * torch.randn(count, 2, generator=torch.Generator().manual_seed(6), dtype=torch.float64)


def shift_of(condition: torch.Tensor) -> torch.Tensor:
    """Any map from conditions to goals [m]."""
    return torch.stack([condition[0] - condition[1], condition.square().sum()])


def in_frame(x: torch.Tensor, condition: torch.Tensor) -> torch.Tensor:
    """States as the joint field takes them."""
    own = (x - shift_of(condition)) / FRAME["stretch"]
    return torch.cat([own, condition.expand(len(x), -1)], -1)


def test_a_fixed_condition_gives_what_the_joint_field_gives_beside_it(field):
    x, elapsed_s = states(12), torch.linspace(0, 4, 12, dtype=torch.float64)[:, None]
    for condition in conditions(3):
        plain = given(field, condition, shift_of(condition), **FRAME)
        joint = field.velocity(in_frame(x, condition), elapsed_s / FRAME["slowdown"])
        assert_close(plain.velocity(x, elapsed_s), joint[:, :2] * (FRAME["stretch"] / FRAME["slowdown"]))
        assert_close(joint[:, 2:], torch.zeros(12, CONTEXT, dtype=torch.float64), rtol=0, atol=0)
        assert_close(plain.chart.to_ambient(plain.chart.to_latent(x)), x)


def test_trajectories_in_closed_form_keep_the_condition():
    field, x, times_s = exact("linear"), states(4), torch.linspace(0, 3, 7, dtype=torch.float64)
    (condition,) = conditions(1)
    plain = given(field, condition, shift_of(condition), **FRAME)
    joint = field.solve(in_frame(x, condition), times_s / FRAME["slowdown"])
    assert_close(plain.solve(x, times_s), joint[..., :2] * FRAME["stretch"] + shift_of(condition))
    assert_close(joint[..., 2:], condition.expand(4, 7, -1))


def embedded() -> ChartedField:
    """A skill of one dimension beside two others, which have a clock of their own, in a flow with conditions."""
    torch.manual_seed(0)
    field = Standing(EmbeddedField(LinearField(1, RATE, 1.0), 3, 5.0), CONTEXT)
    chart = ComposedChart(ScalingChart(torch.zeros(3 + CONTEXT), 0.1), CouplingFlow(3, 4, 16, [0.5, 1.0], 1.5, CONTEXT))
    anchored, clock = AnchoredChart(chart, torch.zeros(3 + CONTEXT)), RisingClock(0.1, 0.4)
    return disturbed(ChartedField(anchored, field, TIME_UNIT_S, ConditionalTimeLaw(CONTEXT, 6, 0.2), clock))


def test_what_is_beside_an_embedded_skill_has_its_own_clock_under_every_condition():
    field, times_s = embedded(), torch.linspace(0, 4, 81, dtype=torch.float64)
    x = 0.1 * torch.randn(4, 3, generator=torch.Generator().manual_seed(6), dtype=torch.float64)
    shift, still = torch.zeros(3, dtype=torch.float64), field.transverse_law
    for condition in conditions(2):
        plain = given(field, condition, shift)
        assert plain.transverse_law is still
        joint = torch.cat([x, condition.expand(4, -1)], -1)
        exact = field.solve(joint, times_s)
        assert_close(plain.solve(x, times_s), exact[..., :3])
        assert_close(rollout(plain, x, times_s, method="rk4", substeps=4).states, exact[..., :3], rtol=0, atol=1e-5)
        assert_close(field.velocity(joint, times_s[:4, None])[:, :3], plain.velocity(x, times_s[:4, None]))
        beside = plain.chart.to_latent(exact[:, -1, :3])[:, 1:] / plain.chart.to_latent(x)[:, 1:]
        passed = still.progress(times_s[-1] / TIME_UNIT_S)
        assert_close(beside, (-5.0 * passed).exp().expand(4, 2), rtol=1e-4, atol=0)


def test_states_of_several_conditions_are_followed_side_by_side():
    field, several, times = exact("linear"), conditions(5), torch.linspace(0, 3, 7, dtype=torch.float64)
    x = torch.cat([states(5), several], -1)
    together = field.solve(x, times)
    for number in range(5):
        assert_close(together[number], field.solve(x[number : number + 1], times)[0])
    own_times = torch.rand(5, 4, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    assert_close(field.solve(x, own_times)[2], field.solve(x[2:3], own_times[2])[0])


def test_a_linear_field_has_a_matrix_for_each_condition_that_contracts_at_least_at_the_guaranteed_rate():
    torch.manual_seed(1)
    field = ConditionalLinear(3, 2, RATE, 1.0).double()
    assert_close(field.given(torch.tensor([0.3, 0.7], dtype=torch.float64)).matrix, -torch.eye(3, dtype=torch.float64))
    torch.nn.init.normal_(field.symmetric_roots)
    torch.nn.init.normal_(field.skew_roots)
    rates = []
    for condition in 3 * torch.randn(200, 2, dtype=torch.float64):
        plain, z = field.given(condition), torch.randn(4, 3, dtype=torch.float64)
        assert_close(plain(z), field(torch.cat([z, condition.expand(4, -1)], -1))[:, :3])
        rates.append(plain.rate)
    assert min(rates) >= RATE - 1e-12
    assert max(rates) > 1.1 * min(rates)


def test_the_condition_moves_the_equilibrium(field):
    for condition in conditions(5):
        goal = shift_of(condition)
        plain = given(field, condition, goal)
        assert_close(plain(goal), torch.zeros(2, dtype=torch.float64), rtol=0, atol=1e-12)
        assert_close(plain.chart.to_latent(goal), torch.zeros(2, dtype=torch.float64), rtol=0, atol=1e-12)


def test_every_condition_contracts_in_its_metric_at_its_proven_rate(field):
    x = states(40)
    for condition in conditions(6):
        plain = given(field, condition, shift_of(condition), **FRAME)
        largest = eigenvalues_in_metric(plain, plain.chart, x)[:, -1].max()
        assert float(largest) <= -plain.field.rate / (FRAME["slowdown"] * TIME_UNIT_S) + 1e-6
        assert plain.field.rate >= RATE


def test_after_a_change_the_distance_to_the_new_goal_falls_at_the_proven_rate():
    """‖ψ_c'(x_t)‖ ≤ e^{-τ(t-s)} ‖ψ_c'(x_s)‖, wherever the change finds the robot."""
    field, times = exact("linear"), torch.linspace(0, 4, 30, dtype=torch.float64)
    first, second = (given(field, condition, shift_of(condition)) for condition in conditions(2))
    at_change = first.solve(states(50), times[:10])[:, -1]
    after = second.chart.to_latent(second.solve(at_change, times)).norm(dim=-1)
    decay = torch.exp(-second.field.rate * second.time_law.progress(times / TIME_UNIT_S))
    assert bool((after <= decay * after[:, :1] * (1 + 1e-9)).all())


def test_two_robots_under_the_same_changes_approach_up_to_the_jumps_of_the_metric():
    """κ e^{-Σ τᵢ θᵢ} with κ the product of what each change of chart stretches distances by."""
    field, stretch, exponent = exact("linear"), 1.0, 0.0
    plain = [given(field, condition, shift_of(condition)) for condition in conditions(4)]
    pair, duration = states(2), 0.7
    begun = latent_distance(plain[0], pair)
    for now, later in zip(plain, [*plain[1:], plain[-1]], strict=True):
        pair = now.solve(pair, torch.tensor([duration], dtype=torch.float64))[:, 0]
        stretch *= latent_distance(later, pair) / latent_distance(now, pair)
        exponent += now.field.rate * float(now.time_law.progress(torch.tensor(duration / TIME_UNIT_S)))
    assert latent_distance(plain[-1], pair) <= stretch * math.exp(-exponent) * begun * (1 + 1e-6)


def latent_distance(field: ChartedField, pair: torch.Tensor) -> float:
    first, second = field.chart.to_latent(pair)
    return float((first - second).norm().detach())


def test_the_thesis_field_sees_the_condition_in_all_its_networks(line_integral):
    x, several = states(6), conditions(6)
    joint = line_integral(torch.cat([x, several], -1))
    for number, condition in enumerate(several):
        plain = line_integral.given(condition)
        assert_close(plain(x[number]), joint[number, :2])
        root = plain.jacobian_root(x[number])
        assert_close(root, line_integral.field.jacobian_root(torch.cat([x[number], condition])))
        largest = torch.linalg.eigvalsh((plain.contraction_jacobian(x) + plain.contraction_jacobian(x).mT) / 2).max()
        assert largest < 0
    first, second = (line_integral.given(condition) for condition in several[:2])
    assert float((first(x) - second(x)).detach().norm()) > 1e-3
    assert float((first.regulariser(x) - second.regulariser(x)).detach().norm()) > 1e-6
    assert_close(first(first.base_point), first.base_velocity)


def test_a_batch_of_conditions_is_judged_row_by_row(line_integral):
    x, several = states(4), conditions(4)
    rows = line_integral.given(several)
    jacobians = field_jacobian(rows, x)
    for number, condition in enumerate(several):
        (alone,) = field_jacobian(line_integral.given(condition), x[number : number + 1])
        assert_close(jacobians[number], alone)


def test_a_motion_that_is_continued_goes_on_where_it_was():
    """Half of the way and the rest of it are the whole, also where the time law is not that of a clock."""
    field, (condition,) = exact("linear"), conditions(1)
    plain = given(field, condition, shift_of(condition), **FRAME)
    half, whole = torch.tensor([0.9], dtype=torch.float64), torch.tensor([0.9, 2.3], dtype=torch.float64)
    middle = plain.solve(states(3), half)[:, 0]
    assert_close(plain.later(0.9).solve(middle, whole[1:] - half)[:, 0], plain.solve(states(3), whole)[:, 1])
    elapsed = torch.tensor([[0.4]], dtype=torch.float64)
    assert_close(plain.later(0.9).velocity(middle, elapsed), plain.velocity(middle, elapsed + 0.9))
