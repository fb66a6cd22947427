from dataclasses import replace

import pytest
import torch

from geomotion.config import FlowChart, LearnedTimeLaw, LinearField, NoRegulariser, NoTimeLaw, TrajectoryTraining
from geomotion.dynamics.start_memory import StartMemory
from geomotion.models import ModelConfig, build
from geomotion.training.data import Geometry, TrainingSet
from geomotion.training.trajectories import TrajectoryReproduction, nearest_curves, squared_distance_to_curve


@pytest.fixture
def spirals() -> TrainingSet:
    """Exact solutions of a contracting linear system, of different lengths."""
    times, states, velocities = [], [], []
    matrix = torch.tensor([[-1.0, -2.0], [2.0, -1.0]])
    for start, points in (((0.1, 0.0), 80), ((0.08, 0.02), 120), ((0.09, -0.03), 100)):
        time = torch.linspace(0, 3, points)
        path = torch.linalg.matrix_exp(matrix * time[:, None, None]) @ torch.tensor(start)
        times.append(time)
        states.append(path)
        velocities.append(path @ matrix.T)
    return TrainingSet(tuple(times), tuple(states), tuple(velocities))


@pytest.fixture
def objective_and_model(spirals):
    geometry = Geometry.of(spirals)
    field = LinearField(min_rate_per_duration=0.1, initial_rate_per_duration=2.0)
    model = build(ModelConfig(FlowChart(layers=2, features=8), field, NoRegulariser(), 0), geometry).train()
    settings = TrajectoryTraining(mixing=0.0, start_noise=0.0, velocity_weight=1.0)
    return TrajectoryReproduction(spirals, geometry, settings), model, geometry


def generator() -> torch.Generator:
    return torch.Generator().manual_seed(0)


def test_the_true_system_has_almost_no_loss(objective_and_model):
    objective, model, geometry = objective_and_model
    before = float(objective(model, 0.9, generator())["nearest_point"].detach())
    with torch.no_grad():  # the flow is still the identity, so A is the true matrix in time units of the duration
        true = torch.tensor([[-1.0, -2.0], [2.0, -1.0]]) * geometry.duration_s
        symmetric, skew = -(true + true.T) / 2 - 0.1 * torch.eye(2), (true - true.T) / 2
        model.field.symmetric_root.copy_(torch.linalg.cholesky(symmetric).T)
        model.field.skew_root.copy_(torch.triu(skew))
        model.chart.anchor.zero_()
        after = objective(model, 0.9, generator())
    assert float(after["velocity"]) < 1e-5
    assert float(after["end"]) < 1e-4
    assert float(after["equal_time"]) < 1e-5
    assert float(after["nearest_point"]) < 0.02 * before


def test_the_nearest_point_term_begins_after_the_warm_up(objective_and_model):
    objective, model, _ = objective_and_model
    terms = {"velocity", "haste", "weights", "end", "equal_time"}
    assert set(objective(model, 0.39, generator())) == terms
    assert set(objective(model, 0.41, generator())) == terms | {"nearest_point"}


def test_the_same_generator_gives_the_same_losses(objective_and_model):
    objective, model, _ = objective_and_model
    first, second = (objective(model, 0.9, generator()) for _ in range(2))
    torch.testing.assert_close(first, second, rtol=0, atol=0)


def test_one_demonstration_is_enough(spirals):
    alone = TrainingSet(spirals.times[:1], spirals.states[:1], spirals.velocities[:1])
    geometry = Geometry.of(alone)
    model = build(ModelConfig(FlowChart(), LinearField(), NoRegulariser(), 0), geometry).train()
    losses = TrajectoryReproduction(alone, geometry, TrajectoryTraining(mixing=0.5))(model, 0.9, generator())
    assert all(bool(torch.isfinite(value)) for value in losses.values())


def test_distance_to_a_polyline_is_the_distance_to_its_segments():
    curve = torch.tensor([[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]])
    points = torch.tensor([[[0.5, 0.25], [1.5, 0.5], [-1.0, 0.0]]])
    nearest = torch.tensor([[0, 2, 0]])
    expected = torch.tensor([[0.0625, 0.25, 1.0]])
    torch.testing.assert_close(squared_distance_to_curve(points, curve, nearest), expected)


def test_curves_are_paired_with_those_that_are_like_them():
    curves = torch.tensor([0.0, 1.0, 10.0, 12.0]).view(4, 1, 1).expand(4, 3, 2)
    assert nearest_curves(curves, 1).flatten().tolist() == [1, 0, 3, 2]
    assert nearest_curves(curves, 2).tolist() == [[1, 2], [0, 2], [3, 1], [2, 1]]
    assert nearest_curves(curves[:1], 2).tolist() == [[0]]


def test_only_speeds_above_the_demonstrated_ones_count_as_haste(objective_and_model):
    objective, _, _ = objective_and_model
    slow = objective.top_speed * torch.tensor([[0.5, 0.0], [0.0, -1.0]])
    assert float(objective._haste(slow)) < 1e-10
    assert float(objective._haste(3 * slow)) > 0.1


def test_a_time_law_changes_when_states_are_reached_and_how_fast_but_not_which(spirals):
    geometry = Geometry.of(spirals)
    settings = TrajectoryTraining(start_noise=0.0, mixing=0.0)
    plain = ModelConfig(FlowChart(layers=2), LinearField(), NoRegulariser(), 0)
    autonomous, timed = (build(replace(plain, time_law=law), geometry) for law in (NoTimeLaw(), LearnedTimeLaw()))
    with torch.no_grad():
        timed.time_law.raw_speeds.copy_(torch.linspace(-1, 1, len(timed.time_law.raw_speeds)))
    times_s = torch.linspace(0, 2 * geometry.duration_s, 9)
    start = spirals.states[0][:1]
    progress_s = timed.time_law.progress(times_s / geometry.duration_s) * geometry.duration_s
    torch.testing.assert_close(timed.solve(start, times_s), autonomous.solve(start, progress_s))
    objective = TrajectoryReproduction(spirals, geometry, settings)
    losses = objective(timed.train(), 0.9, generator())
    assert losses["velocity"] != objective(autonomous.train(), 0.9, generator())["velocity"]
    sum(losses.values()).backward()
    assert timed.time_law.raw_speeds.grad.abs().sum() > 0


def test_haste_costs_nothing_where_it_has_no_weight(spirals):
    geometry = Geometry.of(spirals)
    model = build(ModelConfig(FlowChart(layers=2), LinearField(), NoRegulariser(), 0), geometry).train()
    losses = TrajectoryReproduction(spirals, geometry, TrajectoryTraining(haste_weight=0.0))(model, 0.0, generator())
    assert "haste" not in losses


def test_curves_are_compared_by_the_nearest_points_of_each_part(spirals):
    """Parts that pass the same points in another order are alike, though no state of the one curve is on the other."""
    geometry, settings = (
        Geometry.of(spirals),
        TrajectoryTraining(nearest_point_weight=0.0, nearest_point_mean_weight=1.0),
    )
    one = torch.rand(1, 64, 2, generator=generator())
    other = torch.stack([one[..., 0], one[..., 1].flip(1)], -1)
    whole, parts = (TrajectoryReproduction(spirals, geometry, settings, sizes) for sizes in (None, (1, 1)))
    assert float(parts._nearest_point(one, other)) < 0.1 * float(whole._nearest_point(one, other))


def test_without_their_offsets_demonstrations_begin_alike_and_end_where_they_did(spirals):
    memory = StartMemory(2, fade_s=0.5 * min(float(times[-1]) for times in spirals.times))
    starts = torch.stack([states[0] for states in spirals.states])
    memory.learn(starts)
    left = spirals.without_offsets(memory)
    for times, states, velocities, shown in zip(left.times, left.states, left.velocities, spirals.states, strict=True):
        torch.testing.assert_close(states[0], memory.mean_start)
        torch.testing.assert_close(states[-1], shown[-1])
        slope = torch.gradient(states, spacing=(times,), dim=0)[0]
        torch.testing.assert_close(velocities[1:-1], slope[1:-1], rtol=0.05, atol=0.05 * float(slope.abs().max()))
