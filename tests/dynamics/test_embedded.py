"""A skill of few dimensions contracts in all of them, with a clock of its own for what is beside it."""

import pytest
import torch

from geomotion.dynamics.certificate import Claim, certify, slowest_rate
from geomotion.dynamics.charts import IdentityChart, TurnedChart
from geomotion.dynamics.conditional import Standing
from geomotion.dynamics.embedded import EmbeddedField, RisingClock
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.linear import LinearField
from geomotion.dynamics.potential import PotentialField
from geomotion.dynamics.rollout import rollout
from geomotion.dynamics.time_law import SplineTimeLaw

DIM, SKILL_DIM = 5, 2


def field(rate: float = 8.0) -> EmbeddedField:
    torch.manual_seed(0)
    along = LinearField(SKILL_DIM, 1.0, 2.0)
    with torch.no_grad():
        along.symmetric_root.add_(torch.randn(SKILL_DIM, SKILL_DIM))
        along.skew_root.add_(torch.randn(SKILL_DIM, SKILL_DIM))
    return EmbeddedField(along, DIM, rate).double()


def model(rate: float = 8.0) -> ChartedField:
    law = SplineTimeLaw(4, 0.2).double()
    with torch.no_grad():
        law.raw_speeds.add_(torch.randn(5, generator=torch.Generator().manual_seed(0)))
    return ChartedField(IdentityChart(DIM), field(rate), 2.0, law, RisingClock(0.1, 0.4)).eval()


def starts(count: int) -> torch.Tensor:
    return torch.randn(count, DIM, generator=torch.Generator().manual_seed(1), dtype=torch.float64)


def test_closed_form_is_what_a_solver_finds() -> None:
    times = torch.linspace(0, 3, 61, dtype=torch.float64)
    exact = model().solve(starts(4), times)
    solved = rollout(model(), starts(4), times, method="rk4", substeps=4).states
    torch.testing.assert_close(exact, solved, rtol=0, atol=1e-4)


def test_around_a_potential_field_there_is_no_closed_form() -> None:
    around = EmbeddedField(PotentialField(SKILL_DIM, 8, 1.0, 2.0), DIM, 8.0)
    for one in (around, Standing(around, 2)):
        assert not ChartedField(IdentityChart(one.dim), one, 2.0).is_solvable
    start, times = torch.zeros(1, DIM), torch.linspace(0, 1, 5)
    assert rollout(ChartedField(IdentityChart(DIM), around, 2.0), start, times).method == "rk4"
    assert model().is_solvable and ChartedField(IdentityChart(DIM + 2), Standing(field(), 2), 2.0).is_solvable


def test_a_later_start_goes_on_as_before() -> None:
    times = torch.linspace(0, 3, 31, dtype=torch.float64)
    whole = model().solve(starts(4), times)
    rest = model().later(float(times[10])).solve(whole[:, 10], times[10:] - times[10])
    torch.testing.assert_close(rest, whole[:, 10:], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("rate", [0.5, 8.0, 40.0])
def test_distances_fall_at_the_proven_rate_at_all_times(rate: float) -> None:
    one = model(rate)
    times = torch.linspace(0, 3, 200, dtype=torch.float64)
    paths = one.solve(starts(20), times)
    apart = (paths[:10] - paths[10:]).norm(dim=-1)
    factor = torch.exp(-slowest_rate(one) / one.time_unit_s * (times[1] - times[0]))
    assert bool((apart[:, 1:] <= factor * apart[:, :-1] * (1 + 1e-12)).all())


def test_certificate_is_that_of_all_dimensions() -> None:
    certificate = certify(model(), starts(10))
    assert certificate.claim is Claim.by_construction
    assert certificate.rate_per_s == pytest.approx(slowest_rate(model()) / 2.0)
    assert f"{SKILL_DIM} of {DIM}" in certificate.reason


def test_what_is_beside_the_skill_leaves_it_alone() -> None:
    """Projected first or last, the skill coordinates move alike, and those beside vanish."""
    times = torch.linspace(0, 3, 5, dtype=torch.float64)
    one = model()
    beside, projected = one.solve(starts(4), times), one.solve(one.field.project(starts(4)), times)
    torch.testing.assert_close(beside[..., :SKILL_DIM], projected[..., :SKILL_DIM])
    assert bool((projected[..., SKILL_DIM:] == 0).all())


def test_rate_beside_the_skill_may_change_after_training() -> None:
    one = field()
    assert one.rate == pytest.approx(one.field.rate)
    one.transverse_rate.fill_(0.5)
    assert one.rate == 0.5
    z = starts(3)
    torch.testing.assert_close(one(z)[:, SKILL_DIM:], -0.5 * z[:, SKILL_DIM:])


def test_progress_of_the_rising_clock_is_the_integral_of_its_speed() -> None:
    clock = RisingClock(0.1, 0.4)
    times = torch.linspace(0, 1, 1001, dtype=torch.float64)
    summed = torch.cumulative_trapezoid(clock.speed(times), times)
    torch.testing.assert_close(clock.progress(times)[1:], summed, atol=1e-6, rtol=0)


def test_turned_chart_goes_along_its_axes() -> None:
    axes, _ = torch.linalg.qr(starts(DIM))
    chart = TurnedChart(axes)
    torch.testing.assert_close(chart.to_ambient(chart.to_latent(starts(7))), starts(7))
    z, push = chart.linearise(axes.T)
    torch.testing.assert_close(z, torch.eye(DIM, dtype=torch.float64), atol=1e-12, rtol=0)
    torch.testing.assert_close(push(z), axes.T)
