"""What is carried along ends at rest, and comes as near to what is asked for as that lets it."""

import torch

from geomotion.dynamics.fading_spline import FadingSpline

SHARES = torch.linspace(0, 1, 201, dtype=torch.float64)


def bow(shares: torch.Tensor) -> torch.Tensor:
    """From (1, 0), on the move, to rest at zero."""
    return torch.stack([(1 - shares).clamp(min=0).pow(3), (2 * torch.pi * shares).sin().pow(3)], dim=-1)


def fitted(intervals: int, values: torch.Tensor) -> FadingSpline:
    spline = FadingSpline(values.shape[1], intervals).double()
    spline.fit(values)
    return spline


def test_the_first_value_is_met_and_nothing_is_left_at_the_end_whatever_was_asked_for() -> None:
    spline = fitted(16, bow(SHARES) + SHARES[:, None])
    before, after = torch.tensor([[-0.5, 0.0], [1.0, 1.5]], dtype=torch.float64)
    torch.testing.assert_close(spline.at(before), bow(SHARES[:1]).expand(2, -1))
    for values in (spline.at(after), spline.rate(after)):
        torch.testing.assert_close(values, torch.zeros(2, 2, dtype=torch.float64), rtol=0, atol=1e-12)


def test_rates_are_derivatives() -> None:
    spline = fitted(16, torch.randn(40, 2, generator=torch.Generator().manual_seed(0), dtype=torch.float64))
    shares = torch.rand(50, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    step = 1e-6
    slope = (spline.at(shares + step) - spline.at(shares - step)) / (2 * step)
    torch.testing.assert_close(spline.rate(shares), slope, rtol=1e-6, atol=1e-6)


def test_a_curve_that_ends_at_rest_is_approached_with_the_fourth_power_of_the_interval() -> None:
    errors = [float((fitted(count, bow(SHARES)).at(SHARES) - bow(SHARES)).abs().max()) for count in (8, 16, 32)]
    assert errors[1] < errors[0] / 8 and errors[2] < errors[1] / 8


def test_fewer_values_than_coefficients_are_met() -> None:
    values = bow(torch.linspace(0, 1, 12, dtype=torch.float64))
    found = fitted(64, values).at(torch.linspace(0, 1, 12, dtype=torch.float64))
    torch.testing.assert_close(found, values, rtol=0, atol=1e-9)
