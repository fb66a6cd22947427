import pytest
import torch

from geomotion.dynamics.charts import AnchoredChart, ComposedChart, IdentityChart, ScalingChart
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.linear import LinearField
from geomotion.networks.coupling import CouplingFlow


def random_flow(dim: int, seed: int = 0) -> CouplingFlow:
    """A flow with parameters far from its initial identity."""
    torch.manual_seed(seed)
    flow = CouplingFlow(dim, layers=6, features=24, length_scales=(0.5, 1.0), log_scale_cap=1.5).double()
    with torch.no_grad():
        for parameter in flow.parameters():
            parameter.copy_(0.5 * torch.randn_like(parameter))
    return flow


def scaling(dim: int) -> ScalingChart:
    return ScalingChart(torch.linspace(-1, 1, dim, dtype=torch.float64), 0.4)


CHARTS = {
    "identity": lambda dim: IdentityChart(dim),
    "scaling": scaling,
    "flow": random_flow,
    "composed": lambda dim: ComposedChart(scaling(dim), random_flow(dim)),
    "anchored": lambda dim: AnchoredChart(random_flow(dim), torch.full((dim,), 0.2, dtype=torch.float64)),
}


@pytest.fixture(params=list(CHARTS))
def make_chart(request):
    return CHARTS[request.param]


@pytest.mark.parametrize("dim", [2, 3, 4, 8])
@pytest.mark.parametrize("shape", [(), (3,), (2, 3)])
class TestEveryChart:
    def test_inverse_returns_to_the_start(self, make_chart, dim, shape):
        chart, x = make_chart(dim), torch.randn(*shape, dim, dtype=torch.float64)
        torch.testing.assert_close(chart.to_ambient(chart.to_latent(x)), x)
        torch.testing.assert_close(chart.to_latent(chart.to_ambient(x)), x)

    def test_linearisation_agrees_with_automatic_differentiation(self, make_chart, dim, shape):
        chart, x = make_chart(dim), torch.randn(*shape, dim, dtype=torch.float64)
        tangent = torch.randn_like(x)
        z, push_forward = chart.linearise(x)
        torch.testing.assert_close(z, chart.to_latent(x))
        _, expected = torch.func.jvp(chart.to_ambient, (z,), (tangent,))
        torch.testing.assert_close(push_forward(tangent), expected)


def test_a_new_flow_is_the_identity():
    x = torch.randn(5, 3)
    torch.testing.assert_close(CouplingFlow(3, 4, 16, (0.5,), 1.5).to_latent(x), x)


@pytest.mark.parametrize("training", [True, False])
def test_an_anchored_chart_maps_its_anchor_to_the_origin(training):
    anchor = torch.tensor([0.3, -0.1], dtype=torch.float64)
    chart = AnchoredChart(random_flow(2), anchor).train(training)
    torch.testing.assert_close(chart.to_latent(anchor), torch.zeros(2, dtype=torch.float64))


def test_an_anchored_chart_follows_new_parameters_after_evaluation():
    chart = AnchoredChart(random_flow(2), torch.tensor([0.3, -0.1], dtype=torch.float64)).eval()
    before = chart.image.clone()
    chart.train()
    with torch.no_grad():
        for parameter in chart.parameters():
            parameter.add_(0.1)
    chart.eval()
    assert not torch.allclose(chart.image, before)
    torch.testing.assert_close(chart.to_latent(chart.anchor), torch.zeros(2, dtype=torch.float64))


@pytest.mark.parametrize("dim", [2, 4])
@pytest.mark.parametrize("seed", range(5))
def test_charted_trajectories_contract_in_the_pulled_back_metric(dim, seed):
    chart = AnchoredChart(ComposedChart(scaling(dim), random_flow(dim, seed)), torch.zeros(dim, dtype=torch.float64))
    field = LinearField(dim, min_rate=0.4, initial_rate=2.0).double()
    with torch.no_grad():
        field.skew_root.copy_(torch.randn(dim, dim))
        field.symmetric_root.copy_(torch.randn(dim, dim))
    model = ChartedField(chart, field, time_unit_s=2.5).eval()
    start = 0.3 * torch.randn(2, 20, dim, dtype=torch.float64)
    times = torch.linspace(0, 6, 50, dtype=torch.float64)
    x, y = (model.solve(one, times) for one in start)
    distance = (chart.to_latent(x) - chart.to_latent(y)).norm(dim=-1)
    bound = torch.exp(-field.rate / 2.5 * times) * distance[:, :1]
    assert (distance <= bound * (1 + 1e-7) + 1e-12).all()


def test_the_velocity_is_the_time_derivative_of_the_closed_form():
    chart = AnchoredChart(ComposedChart(scaling(3), random_flow(3)), torch.zeros(3, dtype=torch.float64))
    model = ChartedField(chart, LinearField(3, 0.5, 2.0).double(), time_unit_s=1.7).eval()
    start = 0.2 * torch.randn(6, 3, dtype=torch.float64)
    time, step = torch.tensor([0.4], dtype=torch.float64), 1e-5
    before, now, after = (model.solve(start, time + shift)[:, 0] for shift in (-step, 0.0, step))
    torch.testing.assert_close((after - before) / (2 * step), model(now), rtol=1e-5, atol=1e-7)


def test_the_anchor_is_an_equilibrium():
    anchor = torch.tensor([0.1, 0.2], dtype=torch.float64)
    model = ChartedField(AnchoredChart(random_flow(2), anchor), LinearField(2, 0.5, 2.0).double(), 1.0).eval()
    torch.testing.assert_close(model(anchor), torch.zeros(2, dtype=torch.float64))
