import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from geomotion.dynamics.linear import LinearField, matrix_exponentials


def random_field(seed: int, dim: int) -> LinearField:
    """A field with arbitrary parameters, in double precision."""
    torch.manual_seed(seed)
    field = LinearField(dim, min_rate=0.3, initial_rate=2.0).double()
    with torch.no_grad():
        for parameter in field.parameters():
            parameter.copy_(torch.randn_like(parameter))
    return field


seeds = st.integers(0, 2**31 - 1)


@settings(deadline=None, max_examples=30)
@given(seed=seeds, dim=st.integers(1, 5))
def test_symmetric_part_is_at_most_minus_the_certified_rate(seed, dim):
    field = random_field(seed, dim)
    matrix = field.matrix
    largest = torch.linalg.eigvalsh((matrix + matrix.T) / 2).max().detach()
    assert largest <= -0.3 + 1e-12
    torch.testing.assert_close(field.rate, -float(largest))


@settings(deadline=None, max_examples=30)
@given(seed=seeds, dim=st.integers(1, 5))
def test_trajectories_approach_each_other_at_least_at_the_rate(seed, dim):
    field = random_field(seed, dim)
    start = torch.randn(2, dim, dtype=torch.float64)
    times = torch.linspace(0, 3, 40, dtype=torch.float64)
    distance = (field.solve(start[0], times) - field.solve(start[1], times)).norm(dim=-1)
    assert (distance <= torch.exp(-field.rate * times) * distance[0] * (1 + 1e-9)).all()


def test_the_solution_satisfies_the_differential_equation():
    field = random_field(3, 3)
    start = torch.randn(4, 3, dtype=torch.float64)
    time, step = torch.tensor([0.7], dtype=torch.float64), 1e-5
    states = [field.solve(start, time + shift)[:, 0] for shift in (-step, 0.0, step)]
    torch.testing.assert_close((states[2] - states[0]) / (2 * step), field(states[1]), rtol=1e-6, atol=1e-8)


def test_the_solution_starts_at_the_start_for_any_batch_shape():
    field = random_field(1, 2)
    for shape in ((), (3,), (2, 3)):
        start = torch.randn(*shape, 2, dtype=torch.float64)
        states = field.solve(start, torch.tensor([0.0, 1.0], dtype=torch.float64))
        assert states.shape == (*shape, 2, 2)
        torch.testing.assert_close(states[..., 0, :], start)


def test_matrix_exponentials_of_a_rotation_are_rotations():
    angle = torch.tensor([0.0, 0.5, 2.0], dtype=torch.float64)
    generator = torch.tensor([[0.0, -1.0], [1.0, 0.0]], dtype=torch.float64)
    expected = torch.stack(
        [torch.stack([angle.cos(), -angle.sin()], -1), torch.stack([angle.sin(), angle.cos()], -1)], -2
    )
    torch.testing.assert_close(matrix_exponentials(generator, angle), expected)


def test_a_new_field_contracts_at_the_initial_rate():
    torch.testing.assert_close(LinearField(2, min_rate=0.5, initial_rate=3.0).matrix, -3.0 * torch.eye(2))


@settings(deadline=None, max_examples=50)
@given(seed=seeds, spread=st.sampled_from([0.0, 1e-6, 1e-4, 1.0, -1.0]))
def test_the_closed_form_of_2x2_exponentials_agrees_with_the_series(seed, spread):
    generator = torch.Generator().manual_seed(seed)
    rotation = torch.linalg.qr(torch.randn(2, 2, generator=generator, dtype=torch.float64)).Q
    matrix = rotation @ torch.tensor([[-1.0, spread], [1.0, -1.0]], dtype=torch.float64) @ rotation.T
    times = torch.linspace(0, 5, 7, dtype=torch.float64)
    expected = torch.linalg.matrix_exp(matrix * times[:, None, None])
    torch.testing.assert_close(matrix_exponentials(matrix, times), expected, rtol=1e-7, atol=1e-9)


def test_each_trajectory_can_have_its_own_times():
    field = random_field(5, 3)
    start, times = torch.randn(4, 3, dtype=torch.float64), torch.rand(4, 6, dtype=torch.float64)
    each = torch.stack([field.solve(one, own) for one, own in zip(start, times, strict=True)])
    torch.testing.assert_close(field.solve(start, times), each)


def test_each_trajectory_can_have_its_own_matrix():
    """Real, complex and double eigenvalues side by side, with finite gradients."""
    matrices = torch.tensor([[[-1.0, 0.5], [0.5, -2]], [[-1, 3], [-3, -1]], [[-2, 0], [0, -2]]], dtype=torch.float64)
    matrices.requires_grad_()
    times = torch.rand(3, 6, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    found = matrix_exponentials(matrices, times)
    torch.testing.assert_close(found, torch.linalg.matrix_exp(matrices[:, None] * times[..., None, None]))
    (gradient,) = torch.autograd.grad(found.square().sum(), matrices)
    series = torch.linalg.matrix_exp(matrices[:, None] * times[..., None, None]).square().sum()
    torch.testing.assert_close(gradient, torch.autograd.grad(series, matrices)[0])
