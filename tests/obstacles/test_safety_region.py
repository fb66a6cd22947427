"""Safety regions: what calibration guarantees, what modulation leaves of a field, and that motions stay inside."""

import numpy as np
import pytest
import torch
from torch import nn

from geomotion.errors import InvalidSetting, MissingData
from geomotion.manifolds.grid import LatentGrid
from geomotion.obstacles import safe_field
from geomotion.obstacles.safe_field import SafeField, against_geodesic, follow_safely
from geomotion.obstacles.safety_region import (
    Levels,
    Reason,
    SafetyRegion,
    calibrated,
    distance_on_grid,
    narrowest_passage,
)

LEVELS = Levels()
GRID = LatentGrid(np.array([-2.0, -2.0]), np.array([2.0, 2.0]), 61)
RADIUS = GRID.nodes[:, 0] ** 2 + GRID.nodes[:, 1] ** 2
SUPPORT = calibrated("outside of a disc", np.exp(6 * RADIUS), RADIUS > 2, LEVELS)
FROM_OBSTACLE = np.linalg.norm(GRID.nodes - [0.4, 0.0], axis=1)
OBSTACLE = calibrated("a disc in the way", np.exp(-((FROM_OBSTACLE / 0.15) ** 2)), FROM_OBSTACLE < 0.2, LEVELS)
FROM_BAR = np.hypot((GRID.nodes[:, 0] - 0.3) / 0.15, GRID.nodes[:, 1] / 0.5)
BAR = calibrated("a bar across the way", np.exp(-(FROM_BAR**2)), FROM_BAR < 1.2, LEVELS)
GOAL = torch.tensor([0.9, 0.0], dtype=torch.float64)


class Funnel(nn.Module):
    """Straight to the goal; coordinates beyond the plane decay."""

    def __init__(self, dim: int = 2) -> None:
        super().__init__()
        self.dim = dim

    def forward(self, z: torch.Tensor) -> torch.Tensor:
        return nn.functional.pad(GOAL, (0, self.dim - 2)) - z


class Flight(Funnel):
    """Away from the goal, much faster than steps allow."""

    def forward(self, z: torch.Tensor) -> torch.Tensor:
        return -5 * super().forward(z)


def region(*reasons: Reason) -> SafetyRegion:
    """With the way to the goal straight, but past the obstacle by its upper side."""
    distance = distance_on_grid(reasons)
    turn = np.where(GRID.nodes[:, 0] < 0.4, np.abs(GRID.nodes[:, 1] - 0.95), 0.0)
    way = np.linalg.norm(GRID.nodes - GOAL.numpy(), axis=1) + 2 * turn
    return SafetyRegion(GRID, distance, np.where(distance > LEVELS.impenetrable, way, np.inf), LEVELS)


def starts(safe: SafetyRegion, count: int = 100) -> torch.Tensor:
    drawn = 4 * torch.rand(5 * count, 2, generator=torch.Generator().manual_seed(1), dtype=torch.float64) - 2
    return drawn[safe.is_safe(drawn)][:count]


# ---------------------------------------------------------------- levels and calibration
def test_switching_is_exact_at_both_ends():
    ends = torch.tensor([0.0, 1.0, LEVELS.guarded, 10.0, 1e6], dtype=torch.float64)
    torch.testing.assert_close(
        LEVELS.switched(ends, 0.0, 1.0), torch.tensor([0.0, 0, 0, 1, 1]).double(), rtol=0, atol=0
    )
    torch.testing.assert_close(
        LEVELS.switched(ends, 2.0, 1.0), torch.tensor([2.0, 2, 2, 1, 1]).double(), rtol=0, atol=0
    )


def test_switching_is_the_printed_sigmoid_but_for_its_ends():
    distance = torch.linspace(1, 10, 200, dtype=torch.float64)
    printed = 1 / (1 + torch.exp(-2 * (distance - 5.5)))  # Eq. (6.6), (6.7)
    torch.testing.assert_close(LEVELS.switched(distance, 0.0, 1.0), printed, atol=0.004, rtol=0)
    assert (LEVELS.switched(distance, 0.0, 1.0).diff() >= 0).all()


@pytest.mark.parametrize("wrong", [{"impenetrable": 0.0}, {"inactive": 1.0}, {"inactive": 1.005}, {"steepness": 0.0}])
def test_levels_are_in_order(wrong):
    with pytest.raises(InvalidSetting):
        Levels(**wrong)


def test_calibration_puts_all_unsafe_nodes_below_rho_and_the_farthest_at_it():
    is_unsafe = RADIUS > 2
    distance = 1 / SUPPORT.closeness
    assert distance[is_unsafe].max() == pytest.approx(LEVELS.impenetrable)


def test_calibration_does_not_depend_on_the_unit_of_volume():
    scaled = calibrated("", 7.3 * np.exp(6 * RADIUS), RADIUS > 2, LEVELS)
    np.testing.assert_allclose(scaled.closeness, SUPPORT.closeness)


def test_what_is_nowhere_cannot_be_calibrated():
    with pytest.raises(MissingData):
        calibrated("nothing", RADIUS + 1, RADIUS < -1, LEVELS)


def test_the_distance_of_several_reasons_is_at_most_that_of_each():
    both = distance_on_grid([SUPPORT, OBSTACLE])
    each = np.minimum(1 / SUPPORT.closeness, 1 / OBSTACLE.closeness)
    assert (both <= each * (1 + 1e-12)).all()
    assert (both >= each * 2 ** (-1 / 4) * (1 - 1e-12)).all()


def test_the_border_of_the_grid_must_be_unsafe():
    with pytest.raises(InvalidSetting):
        SafetyRegion(GRID, np.full(len(RADIUS), 5.0), np.ones(len(RADIUS)), LEVELS)


# ---------------------------------------------------------------- the modulated field
def test_far_from_the_border_the_field_is_unchanged():
    safe = region(SUPPORT, OBSTACLE)
    points = starts(safe)
    free = points[safe.distance(points) > LEVELS.inactive]
    torch.testing.assert_close(SafeField(Funnel(), safe)(free), Funnel()(free))


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_nothing_crosses_the_border_but_inwards(direction):
    safe = region(SUPPORT, OBSTACLE)
    border = 1.2 * starts(safe)
    for _ in range(5):  # Newton's method
        sight = safe.sight(border)
        border = border + sight.depth * sight.normal
    border = border[(safe.distance(border) - LEVELS.guarded).abs() < 1e-6]
    assert len(border) > 10
    sight, wanted = safe.sight(border), direction * Funnel()(border)
    velocity = SafeField(Funnel(), safe).steered(border, wanted)
    crossing, wanted_crossing = ((v * sight.normal).sum(-1) for v in (velocity, wanted))
    assert (crossing > -1e-5).all()
    is_leaving = wanted_crossing > 0.1
    torch.testing.assert_close(crossing[is_leaving], wanted_crossing[is_leaving], atol=1e-4, rtol=0)


def test_the_other_coordinates_do_not_feel_the_region():
    safe = region(SUPPORT, OBSTACLE)
    z = torch.cat([starts(safe), torch.ones(100, 3, dtype=torch.float64)], dim=1)
    field = SafeField(Funnel(5), safe)
    torch.testing.assert_close(field(z)[:, 2:], -z[:, 2:])
    torch.testing.assert_close(field(z)[:, :2], SafeField(Funnel(), safe)(z[:, :2]))


# ---------------------------------------------------------------- rollouts
def test_motions_stay_in_the_region_and_get_to_the_goal():
    safe = region(SUPPORT, OBSTACLE)
    states, waited = follow_safely(SafeField(Funnel(), safe), starts(safe), torch.linspace(0, 8, 161).double())
    assert safe.is_safe(states).all()
    assert waited == 0
    assert ((states[:, -1] - GOAL).norm(dim=1) < 0.02).all()


def test_only_help_gets_a_motion_past_an_obstacle_in_front_of_which_the_field_comes_together():
    safe = region(SUPPORT, BAR)
    head_on = torch.tensor([[-0.5, 0.1]], dtype=torch.float64)
    times = torch.linspace(0, 10, 101).double()
    stopped, _ = follow_safely(SafeField(Funnel(), safe, onward=None), head_on, times)
    helped, _ = follow_safely(SafeField(Funnel(), safe), head_on, times)
    misled, _ = follow_safely(SafeField(Funnel(), safe, onward=against_geodesic), head_on, times)
    assert stopped[0, -1, 0] < 0.3
    assert helped[0, :, 1].max() > 0.6  # by the upper side, which the way to the goal takes
    assert (helped[0, -1] - GOAL).norm() < 0.02
    assert misled[0, :, 1].max() < 0.2


def test_starts_outside_come_in():
    safe = region(SUPPORT, OBSTACLE)
    outside = torch.tensor([[1.6, 0.3], [-1.7, 1.9], [-3.0, 0.0], [0.45, 0.05]], dtype=torch.float64)
    assert not safe.is_safe(outside).any()
    states, _ = follow_safely(SafeField(Funnel(), safe), outside, torch.linspace(0, 1, 101).double())
    assert safe.is_safe(states[:, -1]).all()


@pytest.mark.parametrize("kind", ["far out", "in the obstacle"])
def test_the_way_in_leads_in_from_everywhere_and_is_never_faster_than_allowed(kind):
    """Also where S is flat: far from the data, and in the middle of the obstacle, where its gradient vanishes."""
    flat = Reason("far out", np.minimum(SUPPORT.volume, SUPPORT.scale * 50), SUPPORT.scale)
    safe = region(flat, OBSTACLE)
    angles = torch.arange(40).double() * 2 * np.pi / 40
    around = torch.stack([angles.cos(), angles.sin()], dim=1)
    outside = 3 * around if kind == "far out" else torch.tensor([0.4, 0.0]).double() + 0.1 * around
    assert not safe.is_safe(outside).any()
    field = SafeField(Funnel(), safe, fastest_return=2.0)
    assert (field(outside).norm(dim=1) <= 2 + 1e-9).all()
    states, _ = follow_safely(field, outside, torch.linspace(0, 2, 101).double())
    assert safe.is_safe(states[:, -1]).all()


def test_large_steps_are_halved_and_never_jump_over_what_is_unsafe():
    safe = region(SUPPORT, OBSTACLE)
    fast = SafeField(Flight(), safe, onward=None)
    states, waited = follow_safely(fast, starts(safe, 20), torch.linspace(0, 0.6, 3).double())
    assert safe.is_safe(states).all()
    assert waited == 0


def test_however_wild_a_field_is_the_work_is_bounded_and_motions_wait_in_the_region(monkeypatch):
    monkeypatch.setattr(safe_field, "FREE_STEPS", 100)
    monkeypatch.setattr(safe_field, "MEAN_STEPS", 5)

    class Wild(Funnel):
        calls = 0

        def forward(self, z: torch.Tensor) -> torch.Tensor:
            self.calls += 1
            return 1e4 * torch.stack([(40 * z[:, 1]).sin(), (40 * z[:, 0]).cos()], dim=1)

    safe, wild = region(SUPPORT, OBSTACLE), Wild()
    states, waited = follow_safely(SafeField(wild, safe), starts(safe, 5), torch.linspace(0, 1, 41).double())
    assert safe.is_safe(states).all()
    assert waited > 0
    fewer = 2 ** (safe_field.FEWER_HALVINGS + 1)
    assert wild.calls <= 4 * (100 + 2 ** (safe_field.MAX_HALVINGS + 1) + 41 * max(5, fewer))


def test_a_motion_cannot_tunnel_through_a_wall():
    wall = calibrated(
        "a wall", np.exp(-(((GRID.nodes[:, 0] - 0.3) / 0.1) ** 2)), np.abs(GRID.nodes[:, 0] - 0.3) < 0.1, LEVELS
    )
    safe = region(SUPPORT, wall)
    before = starts(safe)[starts(safe)[:, 0] < 0.3]
    states, _ = follow_safely(SafeField(Funnel(), safe), before, torch.linspace(0, 5, 26).double())
    assert (states[..., 0] < 0.3).all()


# ---------------------------------------------------------------- passages
ACROSS = np.exp(-(((GRID.nodes[:, 0] - 0.3) / 0.25) ** 2) + np.clip((GRID.nodes[:, 1] / 0.6) ** 2, 0, 6))
WALL = calibrated("a wall with a gap", ACROSS, np.e < ACROSS, LEVELS)


def test_the_narrowest_passage_is_the_saddle_of_the_distance():
    distance = distance_on_grid([WALL])
    first, last = GRID.nearest(np.array([[-1.0, 0.0], [1.5, 0.0]]))
    in_gap = distance[np.isclose(GRID.nodes[:, 0], 0.3, atol=0.04) & (np.abs(GRID.nodes[:, 1]) < 0.04)].min()
    assert narrowest_passage(GRID, distance, np.array([first]), int(last)) == pytest.approx(in_gap, rel=0.02)
    assert narrowest_passage(GRID, distance, np.array([last]), int(last)) == distance[last]


def test_motions_pass_a_bottleneck_once_nu_is_lowered_to_it():
    distance = distance_on_grid([SUPPORT, WALL])
    way = np.linalg.norm(GRID.nodes - GOAL.numpy(), axis=1)
    begin = torch.stack([torch.full((9,), -0.6), torch.linspace(-0.2, 0.2, 9)], dim=1).double()
    first, last = GRID.nearest(begin.numpy()), int(GRID.nearest(GOAL.numpy()[None])[0])
    passage = narrowest_passage(GRID, distance, first, last)
    assert LEVELS.guarded < passage < LEVELS.inactive
    ends = [
        follow_safely(SafeField(Funnel(), SafetyRegion(GRID, distance, way, levels)), begin, torch.linspace(0, 12, 241))
        for levels in (LEVELS, LEVELS.below(passage))
    ]
    stuck, through = ((states[:, -1] - GOAL).norm(dim=-1) > 0.05 for states, _ in ends)
    assert stuck.all() and not through.any()
    assert SafetyRegion(GRID, distance, way, LEVELS).is_safe(ends[1][0]).all()
