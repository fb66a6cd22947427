"""Ball arithmetic contains what it should: exact results of all numbers in the balls, rounding included."""

from fractions import Fraction

import pytest
import torch

from geomotion.dynamics.balls import Ball, linear

torch.manual_seed(0)


def ball(*shape: int, radius: float = 0.1) -> Ball:
    return Ball(torch.randn(shape, dtype=torch.float64), radius * torch.rand(shape, dtype=torch.float64))


def member(x: Ball) -> torch.Tensor:
    """A random number of each ball, next to its edge as often as not; the sum below rounds."""
    share = (4 * torch.rand_like(x.mid) - 2).clamp(-1 + 1e-12, 1 - 1e-12)
    return x.mid + share * x.radius


def contains(x: Ball, values: torch.Tensor) -> bool:
    return bool(((values - x.mid).abs() <= x.radius).all())


OPERATIONS = {
    "sum": lambda x, y: x + y,
    "difference": lambda x, y: x - y,
    "product": lambda x, y: x * y,
    "matrix product": lambda x, y: x @ y,
    "negative": lambda x, y: -x,
    "sum along an axis": lambda x, y: x.sum(-1),
    "transposed": lambda x, y: x.mT,
}


@pytest.mark.parametrize("radius", [0.0, 0.1, 10.0])
@pytest.mark.parametrize("operation", OPERATIONS.values(), ids=OPERATIONS)
def test_results_of_members_are_members_of_the_result(operation, radius):
    x, y = ball(5, 4, 4, radius=radius), ball(5, 4, 4, radius=radius)
    found = operation(x, y)
    for _ in range(50):
        one, other = (number.mid if radius == 0 else member(number) for number in (x, y))
        assert contains(found, operation(one, other))


def test_linear_maps_of_members_are_members():
    weight, x = torch.randn(3, 6, dtype=torch.float64), ball(7, 6)
    assert contains(linear(weight, x), member(x) @ weight.T)


def test_the_smaller_of_two_balls_is_taken_entry_by_entry():
    found = Ball(torch.zeros(2), torch.tensor([1.0, 3.0])).tightest(Ball(torch.ones(2), torch.tensor([2.0, 2.0])))
    assert found.mid.tolist() == [0.0, 1.0]
    assert found.radius.tolist() == [1.0, 2.0]


def test_rounding_is_covered_against_exact_fractions():
    x = torch.rand(300, dtype=torch.float64) * 10.0 ** torch.randint(-9, 9, (300,))
    y = torch.rand(300, dtype=torch.float64)
    found = Ball.exact(x[None]) @ Ball.exact(y[:, None])
    exact = sum(Fraction(a) * Fraction(b) for a, b in zip(x.tolist(), y.tolist(), strict=True))
    assert abs(exact - Fraction(float(found.mid))) <= Fraction(float(found.radius))
    assert float(found.radius) < 1e-12 * float(found.mid)
