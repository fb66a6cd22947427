"""Modulated fields: what happens at surfaces, far away, inside, and along rollouts from random starts."""

import pytest
import torch
from torch import nn
from torch.testing import assert_close

from geomotion.dynamics.rollout import RolloutStatus
from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.obstacles.modulation import ModulatedField, modulation_matrix
from geomotion.obstacles.obstacle import Obstacle, clearance, surface_points
from geomotion.obstacles.rollout import rollout_among_obstacles
from geomotion.obstacles.solids import Box, Ellipsoid, Sphere, unit

ANGLE = torch.tensor(0.5).double()
ROUNDING = 1e-12  # of scenes of a metre


class Linear(nn.Module):
    """ẋ = -x, or with a turn."""

    def __init__(self, dim: int, turn: float = 0.0) -> None:
        super().__init__()
        self.dim = dim
        self.matrix = -torch.eye(dim).double()
        self.matrix[0, 1], self.matrix[1, 0] = turn, -turn

    def forward(self, x):
        return x @ self.matrix.T


class Random(nn.Module):
    """A smooth field without any structure."""

    def __init__(self, dim: int) -> None:
        super().__init__()
        self.dim = dim
        torch.manual_seed(dim)
        self.layers = nn.Sequential(nn.Linear(dim, 20), nn.Tanh(), nn.Linear(20, dim)).double()

    def forward(self, x):
        return self.layers(x)


def rotation(dim: int) -> torch.Tensor:
    matrix = torch.eye(dim).double()
    matrix[:2, :2] = torch.stack([ANGLE.cos(), -ANGLE.sin(), ANGLE.sin(), ANGLE.cos()]).reshape(2, 2)
    return matrix


def make(kind: str, dim: int, centre: float = 1.0, velocity: torch.Tensor | None = None) -> Obstacle:
    at = torch.zeros(dim).double()
    at[0] = centre
    match kind:
        case "sphere":
            return Sphere(at, 0.3, velocity)
        case "ellipsoid":
            return Ellipsoid(at, [0.2, 0.45, 0.3][:dim], rotation(dim), velocity)
    return Box(at, [0.4, 0.8, 0.5][:dim], 0.08, rotation(dim), velocity)


KINDS = ("sphere", "ellipsoid", "box")
OBSTACLES = [(kind, dim) for kind in KINDS for dim in (2, 3)]


def directions(dim: int, count: int = 200) -> torch.Tensor:
    return unit(torch.randn(count, dim, generator=torch.Generator().manual_seed(dim)).double())


def normal_speed(obstacle: Obstacle, x: torch.Tensor, velocity: torch.Tensor) -> torch.Tensor:
    return (obstacle.normal(x) * velocity).sum(dim=-1)


@pytest.mark.parametrize(("kind", "dim"), OBSTACLES)
@pytest.mark.parametrize("reactivity", [0.5, 1.0, 3.0])
def test_the_matrix_has_the_eigenvectors_and_eigenvalues_of_the_thesis(kind, dim, reactivity):
    """(5.10)-(5.12), with the basis written out."""
    obstacle = make(kind, dim)
    x = obstacle.reference + torch.linspace(0.5, 3, 200).double()[:, None] * directions(dim)
    x = x[obstacle.level(x) > 1]
    reference, normal = unit(x - obstacle.reference), obstacle.normal(x)
    tangents = torch.linalg.svd(normal[:, None])[2][:, 1:]  # orthonormal basis of what is across the normal
    basis = torch.cat([reference[:, None], tangents], dim=1).mT
    decay = obstacle.level(x) ** (-1 / reactivity)
    eigenvalues = torch.cat([(1 - decay)[:, None], (1 + decay)[:, None].expand(-1, dim - 1)], dim=1)
    expected = basis @ torch.diag_embed(eigenvalues) @ torch.linalg.inv(basis)
    assert_close(modulation_matrix(obstacle, x, reactivity), expected)


@pytest.mark.parametrize(("kind", "dim"), OBSTACLES)
@pytest.mark.parametrize("escape", [True, False])
def test_nothing_crosses_a_surface_inwards(kind, dim, escape):
    velocity = torch.tensor([0.3, -0.7, 0.2]).double()[:dim]
    for moving in (None, velocity):
        obstacle = make(kind, dim, velocity=moving)
        surface = surface_points(obstacle, directions(dim))
        just_outside = obstacle.reference + (1 + 1e-9) * (surface - obstacle.reference)
        for hold in (True, False):
            field = ModulatedField(Random(dim), [obstacle], escape=escape, hold=hold)
            wanted = normal_speed(obstacle, just_outside, field.field(just_outside) - obstacle.velocity)
            found = normal_speed(obstacle, just_outside, field(just_outside) - obstacle.velocity)
            leaves = (wanted > 0) & (not hold)
            assert_close(found, torch.where(leaves, wanted, 0.0), atol=1e-7, rtol=1e-6)


@pytest.mark.parametrize(("kind", "dim"), OBSTACLES)
def test_velocities_are_continuous_across_the_surface(kind, dim):
    obstacle = make(kind, dim)
    field = ModulatedField(Random(dim), [obstacle])
    surface = surface_points(obstacle, directions(dim)) - obstacle.reference
    inside, outside = (field(obstacle.reference + share * surface) for share in (1 - 1e-9, 1 + 1e-9))
    assert_close(inside, outside, atol=1e-6, rtol=0)


def test_at_the_surface_of_one_of_several_only_this_one_counts():
    obstacles = [make("sphere", 2), make("box", 2, centre=2.0), make("ellipsoid", 2, centre=-1.0)]
    field = ModulatedField(Random(2), obstacles, hold=True)
    for obstacle in obstacles:
        surface = surface_points(obstacle, directions(2))
        x = obstacle.reference + (1 + 1e-9) * (surface - obstacle.reference)
        crossing = normal_speed(obstacle, x, field(x))
        assert (crossing.abs() < 1e-6 * (1 + field.field(x).norm(dim=-1))).all()


@pytest.mark.parametrize(("kind", "dim"), OBSTACLES)
def test_far_away_nothing_changes(kind, dim):
    obstacle = make(kind, dim)
    x = 1e6 * directions(dim)
    assert_close(modulation_matrix(obstacle, x), torch.eye(dim).double().expand(200, dim, dim), atol=1e-9, rtol=0)
    crowd = ModulatedField(Random(dim), [obstacle, make("sphere", dim, centre=-2.0)])
    assert_close(crowd(x), crowd.field(x), atol=1e-9, rtol=1e-9)


@pytest.mark.parametrize(("kind", "dim"), OBSTACLES)
def test_a_start_inside_is_driven_out(kind, dim):
    obstacle = make(kind, dim)
    field = ModulatedField(Linear(dim), [obstacle])
    surface = surface_points(obstacle, directions(dim, 50))
    starts = torch.cat([obstacle.reference[None], obstacle.reference + 0.6 * (surface - obstacle.reference)])
    assert (normal_speed(obstacle, starts[1:], field(starts[1:])) > 0).all()
    end = rollout_among_obstacles(field, starts, torch.linspace(0, 2, 41).double()).states[:, -1]
    assert (obstacle.signed_distance(end) > -1e-6).all()


def test_the_escape_field_frees_starts_that_head_straight_for_the_middle():
    obstacle = make("sphere", 2)
    starts = torch.tensor([[1.8, 0.0], [2.5, 0.0]]).double()
    times = torch.linspace(0, 15, 61).double()
    ends = {}
    for escape in (True, False):
        field = ModulatedField(Linear(2), [obstacle], escape=escape)
        found = rollout_among_obstacles(field, starts, times, goal=torch.zeros(2).double(), goal_tolerance=0.01)
        ends[escape] = set(found.statuses)
    assert ends[False] == {RolloutStatus.stopped_elsewhere}
    assert ends[True] == {RolloutStatus.reached}


def test_a_moving_sphere_pushes_a_resting_state_aside_and_lets_it_return():
    sphere = Sphere(torch.tensor([2.0, 0.05]).double(), 0.3, torch.tensor([-1.0, 0.0]).double())
    times = torch.linspace(0, 8, 161).double()
    field = ModulatedField(Linear(2), [sphere])
    starts = torch.zeros(1, 2).double()
    found = rollout_among_obstacles(field, starts, times, goal=torch.zeros(2).double(), goal_tolerance=0.05)
    assert clearance([sphere], found.states, times).min() > -ROUNDING
    assert found.states[0].norm(dim=-1).max() > 0.2  # it had to give way
    assert set(found.statuses) == {RolloutStatus.reached}


def test_fields_are_differentiable_also_where_obstacles_bring_them_to_rest():
    field = ModulatedField(Linear(2), [make("sphere", 2), make("box", 2, centre=-1.0)])
    x = torch.tensor([[1.3, 0.0], [1.31, 0.0], [0.0, 0.0], [1.0, 0.0]]).double().requires_grad_()
    field(x)[:2].sum().backward()
    assert x.grad.isfinite().all()


def test_closed_forms_are_not_offered_and_misfits_are_refused():
    field = ModulatedField(Linear(2), [make("sphere", 2)])
    times = torch.linspace(0, 1, 5).double()
    assert rollout_among_obstacles(field, torch.full((1, 2), 3.0).double(), times).method == "dopri5"
    with pytest.raises(InvalidSetting, match="closed form"):
        rollout_among_obstacles(field, torch.full((1, 2), 3.0).double(), times, method="closed_form")
    with pytest.raises(ShapeMismatch, match="coordinates of an obstacle"):
        ModulatedField(Linear(3), [make("sphere", 2)])
    with pytest.raises(InvalidSetting, match="reactivity"):
        ModulatedField(Linear(2), [make("sphere", 2)], reactivity=0.0)
