import pytest
import torch

from geomotion.config import FlowChart, LinearField, NoRegulariser, TrajectoryTraining
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
    model = build(ModelConfig(FlowChart(layers=2, features=8), LinearField(), NoRegulariser(), 0), geometry).train()
    return TrajectoryReproduction(spirals, geometry, TrajectoryTraining(mixing=0.0)), model, geometry


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
    assert float(after["velocity"]) < 1e-5 * 0.1
    assert float(after["equal_time"]) < 1e-5
    assert float(after["nearest_point"]) < 0.02 * before


def test_the_nearest_point_term_begins_after_the_warm_up(objective_and_model):
    objective, model, _ = objective_and_model
    assert set(objective(model, 0.39, generator())) == {"velocity", "weights", "equal_time"}
    assert set(objective(model, 0.41, generator())) == {"velocity", "weights", "equal_time", "nearest_point"}


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


def test_haste_is_part_of_the_loss_where_it_has_a_weight(spirals):
    geometry = Geometry.of(spirals)
    model = build(ModelConfig(FlowChart(layers=2), LinearField(), NoRegulariser(), 0), geometry).train()
    losses = TrajectoryReproduction(spirals, geometry, TrajectoryTraining(haste_weight=0.05))(model, 0.0, generator())
    assert set(losses) == {"velocity", "haste", "weights", "equal_time"}
