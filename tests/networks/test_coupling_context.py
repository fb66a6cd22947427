"""A flow with context: a diffeomorphism of the plane for every context, which it leaves alone."""

import pytest
import torch
from torch.func import jvp, vmap
from torch.testing import assert_close

from geomotion.networks.coupling import CouplingFlow

SHAPES = [(2, 1), (2, 3), (3, 2)]  # moved coordinates, context


@pytest.fixture(params=SHAPES, ids=str)
def flow(request) -> CouplingFlow:
    dim, context = request.param
    torch.manual_seed(0)
    flow = CouplingFlow(dim, 4, 12, [0.5, 1.0], 1.5, context).double()
    with torch.no_grad():
        for parameter in flow.parameters():
            parameter.copy_(0.5 * torch.randn(parameter.shape, dtype=torch.float64))
    return flow


def states(flow: CouplingFlow, count: int = 20) -> torch.Tensor:
    return torch.randn(count, flow.dim, generator=torch.Generator().manual_seed(1), dtype=torch.float64)


def test_the_context_is_never_moved(flow):
    x = states(flow)
    for image in (flow.to_latent(x), flow.to_ambient(x), flow.linearise(x)[0]):
        assert_close(image[:, -flow.context :], x[:, -flow.context :], rtol=0, atol=0)
        assert (image[:, : -flow.context] - x[:, : -flow.context]).abs().max() > 0.1


def test_the_inverse_undoes_it_and_the_origin_stays_for_every_context(flow):
    x = states(flow)
    assert_close(flow.to_ambient(flow.to_latent(x)), x)
    x[:, : -flow.context] = 0
    assert_close(flow.to_latent(x), x, rtol=0, atol=1e-12)


def test_pushed_tangents_are_those_of_the_inverse_at_a_fixed_context(flow):
    x, tangents = states(flow), states(flow)
    tangents[:, -flow.context :] = 0
    z, push_forward = flow.linearise(x)
    _, expected = vmap(lambda z, tangent: jvp(flow.to_ambient, (z,), (tangent,)))(z, tangents)
    assert_close(push_forward(tangents), expected)


def test_parameters_are_linear_in_the_context(flow):
    """A context between two others has the parameters between theirs: log-scales and shifts at equal angles."""
    x = states(flow, 1)[0]
    frequencies, weight, bias = flow._layers()[0]
    contexts = states(flow, 2)[:, -flow.context :]
    moved = x[: -flow.context]

    def shift(context: torch.Tensor) -> torch.Tensor:
        return flow._condition(moved, context, frequencies, weight, bias)[1]

    assert_close(shift(contexts.mean(0)), (shift(contexts[0]) + shift(contexts[1])) / 2)
    assert (shift(contexts[0]) - shift(contexts[1])).abs().max() > 1e-3
