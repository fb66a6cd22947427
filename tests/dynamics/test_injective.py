"""A decoder as a chart of its manifold: projection, Algorithm 2, and the way to the manifold."""

import pytest
import torch
from torch.func import jacrev, jvp
from torch.testing import assert_close

from geomotion.dynamics.certificate import Claim, certify
from geomotion.dynamics.charts import AnchoredChart, IdentityChart, ScalingChart
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.injective import DecoderChart, decoded, rollout_on_manifold, transition
from geomotion.dynamics.linear import LinearField
from geomotion.dynamics.rollout import rollout
from geomotion.networks.spline_flow import SplineFlow
from geomotion.scores.jacobians import field_jacobian

DIM, LATENT_DIM, DURATION_S = 5, 2, 2.0


def a_decoder(spread: float) -> DecoderChart:
    """The identity of scaled states where `spread` is 0."""
    torch.manual_seed(0)
    flow = SplineFlow(DIM, layers=3, bins=10, bound=10.0, blocks=2, units=30)
    with torch.no_grad():
        for parameter in flow.parameters():
            parameter.add_(spread * torch.randn_like(parameter))
    return DecoderChart(ScalingChart(torch.linspace(-0.1, 0.1, DIM), 0.05), flow, LATENT_DIM).double()


def a_field(decoder: DecoderChart) -> ChartedField:
    torch.manual_seed(1)
    goal = torch.tensor([0.3, -0.2], dtype=torch.float64)
    field = LinearField(LATENT_DIM, 1.0, 3.0).double()
    latent = ChartedField(AnchoredChart(IdentityChart(LATENT_DIM), goal), field, DURATION_S)
    return decoded(decoder, latent).eval()


@pytest.fixture
def decoder() -> DecoderChart:
    return a_decoder(0.1)


@pytest.fixture
def field(decoder) -> ChartedField:
    return a_field(decoder)


@pytest.fixture
def x() -> torch.Tensor:
    """States beside the manifold."""
    return 0.1 * torch.randn(20, DIM, generator=torch.Generator().manual_seed(2), dtype=torch.float64)


def test_decoding_and_encoding_is_the_identity_of_codes(decoder):
    codes = torch.randn(2, 7, LATENT_DIM, dtype=torch.float64)
    assert_close(decoder.to_latent(decoder.to_ambient(codes)), codes)


def test_projection_removes_the_offset_and_nothing_else(decoder, x):
    code, offset = decoder.split(x)
    assert (offset.norm(dim=-1) > 0.1).all()
    projected_code, projected_offset = decoder.split(decoder.project(x))
    assert_close(projected_code, code)
    assert_close(projected_offset, torch.zeros_like(offset))


def test_the_push_forward_is_the_jacobian_of_the_decoder_at_the_code(decoder, x):
    z, push_forward = decoder.linearise(x[0])
    jacobian = jacrev(decoder.to_ambient)(z)
    assert jacobian.shape == (DIM, LATENT_DIM)
    tangent = torch.tensor([0.7, -1.3], dtype=torch.float64)
    assert_close(push_forward(tangent), jacobian @ tangent)


def test_a_state_moves_as_its_projection_does(field, decoder, x):
    assert_close(field(x), field(decoder.project(x)))


def test_velocities_on_the_manifold_are_tangent_to_it(field, decoder, x):
    on_manifold = decoder.project(x)
    _, offset_rate = jvp(lambda state: decoder.split(state)[1], (on_manifold,), (field(on_manifold).detach(),))
    assert_close(offset_rate, torch.zeros_like(offset_rate), rtol=0, atol=1e-9)


def test_an_offset_is_carried_along_for_ever(x):
    """Algorithm 2 with a flat manifold: not even a little of it decays, while the code reaches its goal."""
    decoder = a_decoder(0.0)
    field = a_field(decoder)
    x = x[:3]
    times = torch.linspace(0, 4 * DURATION_S, 25, dtype=torch.float64)
    end = rollout(field, x, times).states[:, -1]
    assert_close(decoder.split(end)[1], decoder.split(x)[1])
    assert float((decoder.to_latent(end) - field.chart.outer.anchor).detach().norm(dim=-1).max()) < 1e-4


def test_a_transition_leads_to_the_projection_and_its_velocities_are_derivatives(decoder, x):
    shares = torch.linspace(0, 1, 201, dtype=torch.float64)
    states, velocities = transition(decoder, x[0], shares, 0.5)
    assert_close(states[0], x[0])
    assert_close(states[-1], decoder.project(x[0]))
    code, offset = decoder.split(states)
    assert_close(code, code[:1].expand_as(code))
    assert_close(offset, (1 - shares[:, None]) * offset[0])
    assert_close((states[2:] - states[:-2]) / (0.5 * 2 / 200), velocities[1:-1], rtol=1e-2, atol=1e-2)


def test_a_field_on_a_manifold_has_no_closed_form_for_every_state(field):
    assert not field.is_onto and not field.is_solvable


def test_contraction_is_claimed_on_the_manifold_alone(field, x):
    certificate = certify(field, x)
    assert certificate.claim is Claim.by_construction_on_manifold
    assert certificate.rate_per_s == pytest.approx(field.field.rate / DURATION_S)
    assert "Beside the manifold nothing is claimed" in certificate.reason
    eigenvalues = torch.linalg.eigvals(field_jacobian(field, x)).real
    assert (eigenvalues.abs() < 1e-6).sum(dim=-1).ge(DIM - LATENT_DIM).all(), "offsets do not decay"


def test_distances_of_codes_fall_at_the_claimed_rate(field, x):
    times = torch.linspace(0, DURATION_S, 50, dtype=torch.float64)
    codes = field.chart.to_latent(rollout_on_manifold(field, x[:2], times).states)
    distance = (codes[0] - codes[1]).norm(dim=-1)
    bound = torch.exp(-field.field.rate * times / DURATION_S) * distance[0]
    assert (distance <= bound * (1 + 1e-9)).all()
