"""The time law: an increasing change of time with mean speed one over the nominal duration."""

import pytest
import torch

from geomotion.dynamics.time_law import ConditionalTimeLaw, LaterTimeLaw, SplineTimeLaw


@pytest.fixture
def law() -> SplineTimeLaw:
    torch.manual_seed(3)
    law = SplineTimeLaw(knots=7, min_speed=0.1).double()
    torch.nn.init.normal_(law.raw_speeds, std=3.0)
    return law


def test_an_untrained_law_is_the_identity() -> None:
    law = SplineTimeLaw(knots=5, min_speed=0.1).double()
    times = torch.linspace(0, 3, 31, dtype=torch.float64)
    torch.testing.assert_close(law.progress(times), times)
    torch.testing.assert_close(law.speed(times), torch.ones_like(times))


def test_progress_is_zero_at_the_start_and_one_after_the_duration(law: SplineTimeLaw) -> None:
    ends = law.progress(torch.tensor([0.0, 1.0], dtype=torch.float64))
    torch.testing.assert_close(ends, torch.tensor([0.0, 1.0], dtype=torch.float64))


def test_speed_is_the_derivative_of_progress(law: SplineTimeLaw) -> None:
    times = torch.linspace(0.01, 2.5, 97, dtype=torch.float64, requires_grad=True)
    (derivative,) = torch.autograd.grad(law.progress(times).sum(), times)
    torch.testing.assert_close(derivative, law.speed(times))


def test_no_parameters_make_it_slower_than_its_floor(law: SplineTimeLaw) -> None:
    times = torch.linspace(0, 2, 2001, dtype=torch.float64)
    assert law.speed(times).min().item() >= law.min_speed


def test_speed_is_constant_after_the_duration(law: SplineTimeLaw) -> None:
    late = law.speed(torch.tensor([1.0, 1.5, 9.0], dtype=torch.float64))
    torch.testing.assert_close(late, late[:1].expand(3))


def test_a_later_start_continues_the_same_law(law: SplineTimeLaw) -> None:
    later, times = LaterTimeLaw(law, begin=0.4), torch.linspace(0, 2, 21, dtype=torch.float64)
    torch.testing.assert_close(
        law.progress(torch.full_like(times, 0.4)) + later.progress(times), law.progress(times + 0.4)
    )
    torch.testing.assert_close(later.speed(times), law.speed(times + 0.4))


def test_each_condition_has_the_law_of_its_mixed_parameters() -> None:
    torch.manual_seed(4)
    laws = ConditionalTimeLaw(context=3, knots=7, min_speed=0.1).double()
    torch.nn.init.normal_(laws.raw_speeds, std=2.0)
    conditions, times = torch.rand(5, 3, dtype=torch.float64), 2 * torch.rand(5, 4, 6, dtype=torch.float64)
    together = laws.given(conditions)
    for number, condition in enumerate(conditions):
        alone = SplineTimeLaw(knots=7, min_speed=0.1).double()
        with torch.no_grad():
            alone.raw_speeds.copy_(condition @ laws.raw_speeds)
        for one, speed, progress in (
            (laws.given(condition), together.speed(times)[number], together.progress(times)[number]),
            (alone, laws.given(condition).speed(times[number]), laws.given(condition).progress(times[number])),
        ):
            torch.testing.assert_close(one.speed(times[number]), speed)
            torch.testing.assert_close(one.progress(times[number]), progress)
        assert alone.slowest() >= laws.slowest()
    torch.testing.assert_close(together.speed(times[:, 0, 0]), together.speed(times)[:, 0, 0])
