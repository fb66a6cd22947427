"""A motion that remembers its start is one from the mean start, and an offset that fades, with nothing else lost."""

import pytest
import torch

from geomotion.dynamics.certificate import certify, slowest_rate
from geomotion.dynamics.fields import ChartedField
from geomotion.dynamics.rollout import rollout
from geomotion.dynamics.start_memory import REACH, CarriedOffset, StartMemory, faded, fading

from .test_embedded import DIM, SKILL_DIM, model, starts

FADE_S = 1.6
DURATION_S = 2.0
TIMES = torch.linspace(0, 3, 61, dtype=torch.float64)


def remembering(*, on_a_path: bool = False) -> tuple[ChartedField, torch.Tensor]:
    """A field, and what it was told of starts; from the mean one it may have to follow a path."""
    plain, shown = model(), starts(6)
    memory = StartMemory(DIM, FADE_S).double()
    memory.learn(shown)
    clocks = plain.time_unit_s, plain.time_law, plain.transverse_law
    field = ChartedField(plain.chart, plain.field, *clocks, memory).eval()
    if on_a_path:
        field.carry_to(detour(field, torch.linspace(0, DURATION_S, 161, dtype=torch.float64)))
    return field, shown


def detour(field: ChartedField, times_s: torch.Tensor) -> torch.Tensor:
    """From the mean start to the goal, at rest at both ends."""
    assert field.start_memory is not None
    share = times_s.clamp(max=DURATION_S)[:, None] / DURATION_S
    bow = (torch.pi * share).sin().pow(4) * torch.linspace(-1, 1, DIM, dtype=torch.float64)
    return (torch.pi / 2 * share).cos().pow(4) * field.start_memory.mean_start + 0.3 * bow


def test_motions_are_the_nominal_one_and_an_offset_that_fades() -> None:
    field, shown = remembering()
    memory = field.start_memory
    assert memory is not None
    found = rollout(field, shown, TIMES).states
    nominal = model().solve(memory.mean_start[None], TIMES)
    left = faded(TIMES / FADE_S)[:, None] * (shown - memory.mean_start)[:, None]
    torch.testing.assert_close(found, nominal + left)
    torch.testing.assert_close(found[:, 0], shown)
    torch.testing.assert_close(found[:, TIMES > FADE_S], nominal[:, TIMES > FADE_S].expand(6, -1, -1))


def test_motions_follow_the_path_that_was_asked_for_with_their_offsets() -> None:
    field, shown = remembering(on_a_path=True)
    assert field.start_memory is not None
    left = faded(TIMES / FADE_S)[:, None] * (shown - field.start_memory.mean_start)[:, None]
    found = rollout(field, shown, TIMES).states
    torch.testing.assert_close(found[:, 0], shown)
    apart = (found - detour(field, TIMES) - left).abs()
    assert float(apart[:, TIMES <= DURATION_S].max()) < 1e-3
    torch.testing.assert_close(field.start_memory.span_s, TIMES[-1])  # where nothing is carried along any more
    torch.testing.assert_close(
        field.begun(shown).carried.along(TIMES[-1:]), torch.zeros(6, 1, DIM, dtype=torch.float64)
    )


@pytest.mark.parametrize("on_a_path", [False, True])
def test_closed_form_is_what_a_solver_finds(on_a_path: bool) -> None:
    field, shown = remembering(on_a_path=on_a_path)
    solved = rollout(field, 3 * shown, TIMES, method="rk4", substeps=4).states
    torch.testing.assert_close(rollout(field, 3 * shown, TIMES).states, solved, rtol=0, atol=1e-4)


def test_a_motion_from_the_mean_start_is_that_of_the_plain_field() -> None:
    field, _ = remembering()
    assert field.start_memory is not None
    mean = field.start_memory.mean_start[None]
    begun, elapsed_s = field.begun(mean), torch.rand(7, 1, dtype=torch.float64)
    torch.testing.assert_close(begun.velocity(starts(7), elapsed_s), model().velocity(starts(7), elapsed_s))
    torch.testing.assert_close(rollout(field, mean, TIMES).states, model().solve(mean, TIMES))


def test_only_so_much_of_a_start_is_remembered() -> None:
    field, shown = remembering()
    memory = field.start_memory
    assert memory is not None
    farthest = (shown - memory.mean_start).norm(dim=-1).max()
    torch.testing.assert_close(memory.offset(shown), shown - memory.mean_start)
    far = memory.mean_start + 100 * (shown - memory.mean_start)
    torch.testing.assert_close(memory.offset(far).norm(dim=-1), (REACH * farthest).expand(6))
    torch.testing.assert_close(rollout(field, far, TIMES).states[:, 0], far)


@pytest.mark.parametrize("on_a_path", [False, True])
@pytest.mark.parametrize("push", [0.5, 5.0])
def test_what_pushes_a_motion_is_undone_at_the_proven_rate(push: float, on_a_path: bool) -> None:
    """Distances between motions of one start, in the metric at the state less what is carried along."""
    field, shown = remembering(on_a_path=on_a_path)
    begun, begin_s = field.begun(shown), 0.4
    later, times = begun.later(begin_s), TIMES[begin_s <= TIMES] - begin_s
    state = begun.solve(shown, torch.tensor([begin_s], dtype=torch.float64))[:, 0]
    paths = [later.solve(one, times) for one in (state, state + push * starts(6))]
    torch.testing.assert_close(paths[0], begun.solve(shown, times + begin_s))
    apart = (paths[0] - paths[1]).norm(dim=-1)  # the chart is the identity
    bound = apart[:, :1] * torch.exp(-slowest_rate(field) / field.time_unit_s * times)
    assert bool((apart <= bound * (1 + 1e-9)).all())


@pytest.mark.parametrize("on_a_path", [False, True])
def test_pushed_motions_differ_as_those_of_the_plain_field_do(on_a_path: bool) -> None:
    field, shown = remembering(on_a_path=on_a_path)
    assert field.start_memory is not None
    begun, plain, offset = field.begun(shown), model(), field.start_memory.offset(shown)
    elapsed_s = torch.full((6, 1), 0.7, dtype=torch.float64)
    carried = CarriedOffset(offset, field.start_memory)
    expected = plain.velocity(shown - carried.at(elapsed_s), elapsed_s) + carried.velocity(elapsed_s)
    torch.testing.assert_close(begun.velocity(shown, elapsed_s), expected)
    torch.testing.assert_close(begun.forgetful().velocity(shown, elapsed_s), plain.velocity(shown, elapsed_s))


def test_an_offset_changes_as_its_velocity_says_and_begins_and_ends_at_rest() -> None:
    share = torch.linspace(-0.2, 1.3, 1501, dtype=torch.float64)
    slope = torch.gradient(faded(share), spacing=(share,))[0]
    torch.testing.assert_close(fading(share), slope, rtol=0, atol=5e-3)
    ends = torch.tensor([0.0, 1.0, 2.0], dtype=torch.float64)
    torch.testing.assert_close(faded(ends), torch.tensor([1.0, 0.0, 0.0], dtype=torch.float64))
    torch.testing.assert_close(fading(ends), torch.zeros(3, dtype=torch.float64))


@pytest.mark.parametrize("on_a_path", [False, True])
def test_undisturbed_motions_stay_on_the_skill(on_a_path: bool) -> None:
    """So the rate at which others come back changes nothing about them."""
    field, _ = remembering(on_a_path=on_a_path)
    assert field.start_memory is not None
    if not on_a_path:
        field.begin_on_skill()
    start = field.start_memory.mean_start[None]
    beside = field.start_memory.carried(start).along(TIMES)
    on_skill = rollout(field, start, TIMES).states - beside
    assert float(on_skill[..., SKILL_DIM:].abs().max()) < 1e-12  # the chart is the identity
    before = rollout(field, start, TIMES).states
    field.field.transverse_rate.fill_(3.0)
    torch.testing.assert_close(rollout(field, start, TIMES).states, before)


def test_the_certificate_says_whose_distances_fall() -> None:
    field, _ = remembering()
    with_memory, without = certify(field, starts(10)), certify(model(), starts(10))
    assert with_memory.rate_per_s == without.rate_per_s
    assert "remember" in with_memory.reason
    assert "remember" not in without.reason


def test_what_is_left_where_a_path_ends_fades_as_slowly_as_the_motion_goes_on() -> None:
    """Or the robot, at rest at the goal, would jump when nothing is carried along any more."""
    field, _ = remembering()
    assert field.start_memory is not None
    beside = torch.linspace(0.1, 0.2, DIM, dtype=torch.float64)  # of the goal
    path = detour(field, torch.linspace(0, DURATION_S, 161, dtype=torch.float64))
    field.carry_to(path + torch.linspace(0, 1, 161, dtype=torch.float64)[:, None].square() * beside)
    times = torch.linspace(1.05 * DURATION_S, 2 * DURATION_S, 200, dtype=torch.float64)
    motion = rollout(field, field.start_memory.mean_start[None], torch.cat([torch.zeros(1), times])).states[0, 1:]
    speeds = motion.diff(dim=0).norm(dim=-1) / times.diff()
    assert float(speeds.max()) < 3 * float((motion[0] - motion[-1]).norm()) / (0.45 * DURATION_S)
    assert "lacks" in certify(field, starts(10)).reason
