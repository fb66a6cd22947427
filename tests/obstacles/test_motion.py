"""Moving bodies: where they are, and distances that hold at every time in between."""

import numpy as np
import pytest
import torch

from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.obstacles.motion import ConstantVelocity, MovingBody, Waypoints
from geomotion.obstacles.obstacle import surface_points
from geomotion.obstacles.solids import Box, Ellipsoid, Solid, Sphere, unit

CENTRE = torch.tensor([0.1, 0.0, -0.1]).double()
THERE_AND_BACK = Waypoints(np.array([1.0, 2.0, 4.0]), np.array([[0.0, 0, 0], [0.3, 0, 0], [0.3, -0.4, 0]]))


def states(count: int = 2000) -> np.ndarray:
    return np.random.default_rng(0).uniform(-0.6, 0.6, size=(count, 3))


def solids() -> list[Solid]:
    return [Sphere(CENTRE, 0.1), Ellipsoid(CENTRE, [0.15, 0.1, 0.05]), Box(CENTRE, [0.2, 0.1, 0.3], 0.01)]


def test_waypoints_are_passed_in_time_and_kept_before_and_after():
    offsets = [THERE_AND_BACK.offset(t) for t in (-1.0, 1.0, 1.5, 2.0, 3.0, 4.0, 99.0)]
    expected = [[0, 0, 0], [0, 0, 0], [0.15, 0, 0], [0.3, 0, 0], [0.3, -0.2, 0], [0.3, -0.4, 0], [0.3, -0.4, 0]]
    np.testing.assert_allclose(offsets, expected)


@pytest.mark.parametrize("motion", [THERE_AND_BACK, ConstantVelocity(np.array([0.1, -0.2, 0.0]))])
def test_velocity_is_the_slope_of_the_displacement_and_way_is_the_integral_of_speed(motion):
    for time_s in (0.5, 1.2, 1.9, 2.5, 3.9, 5.0):
        slope = (motion.offset(time_s + 1e-6) - motion.offset(time_s - 1e-6)) / 2e-6
        np.testing.assert_allclose(motion.velocity(time_s), slope, atol=1e-9)
    times_s = np.linspace(0.2, 5.0, 2001)
    speeds = [np.linalg.norm(motion.velocity(float(t))) for t in times_s]
    np.testing.assert_allclose(motion.travelled(0.2, 5.0), np.trapezoid(speeds, times_s), rtol=2e-3)


@pytest.mark.parametrize("solid", solids(), ids=lambda solid: type(solid).__name__)
def test_a_moved_body_is_the_body_at_the_displaced_states(solid):
    moving = MovingBody("cup", solid, THERE_AND_BACK)
    found = moving.signed_distance(states(), 3.0)
    expected = solid.signed_distance(torch.from_numpy(states() - THERE_AND_BACK.offset(3.0))).numpy()
    reach = max(solid.bounding_radius, 0.15)
    is_near = expected <= reach
    np.testing.assert_allclose(found[is_near], expected[is_near], atol=1e-12)
    assert (found <= expected + 1e-12).all()
    assert (found[~is_near] >= reach - 1e-12).all()
    np.testing.assert_allclose(moving.centre_m(3.0), CENTRE.numpy() + np.array([0.3, -0.2, 0]))
    ball = np.linalg.norm(states() - moving.centre_m(3.0), axis=1) - moving.bounding_radius_m
    assert (found >= ball - 1e-12).all()


@pytest.mark.parametrize("solid", solids(), ids=lambda solid: type(solid).__name__)
def test_the_surface_lies_between_the_two_balls_around_the_reference_point_and_touches_the_inner_one(solid):
    directions = unit(torch.randn(20_000, 3, generator=torch.Generator().manual_seed(0)).double())
    radii = (surface_points(solid, directions) - CENTRE).norm(dim=-1)
    assert solid.inradius - 1e-12 <= radii.min() < solid.inradius + 0.002
    assert solid.bounding_radius - 0.005 < radii.max() <= solid.bounding_radius + 1e-12


def test_distances_change_no_faster_than_the_state_moves():
    moving = MovingBody("cup", solids()[2], THERE_AND_BACK)
    x, y = states(), states()[::-1] * 0.3
    change = np.abs(moving.signed_distance(x, 1.5) - moving.signed_distance(y, 1.5))
    assert (change <= np.linalg.norm(x - y, axis=1) + 1e-12).all()


@pytest.mark.parametrize("samples", [2, 3, 8])
def test_a_swept_distance_is_never_above_the_distance_at_any_time_and_close_to_it_with_many_samples(samples):
    moving = MovingBody("cup", solids()[0], THERE_AND_BACK)
    swept = moving.swept_distance(states(), 0.5, 3.0, samples)
    true = np.min([moving.signed_distance(states(), t) for t in np.linspace(0.5, 3.5, 601)], axis=0)
    assert (swept <= true + 1e-12).all()
    many = moving.swept_distance(states(), 0.5, 3.0, 301)
    assert (true - many).max() < 0.003


def test_a_sweep_knows_of_a_way_out_and_back_between_two_samples():
    out_and_back = Waypoints(np.array([0.0, 1.0, 2.0]), np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 0]]))
    moving = MovingBody("pendulum", Sphere(torch.zeros(3).double(), 0.1), out_and_back)
    in_the_way = np.array([[0.9, 0.0, 0.0]])
    assert moving.swept_distance(in_the_way, 0.0, 2.0, samples=2) <= moving.signed_distance(in_the_way, 0.9)


def test_a_resting_body_sweeps_what_it_covers_and_one_with_a_velocity_moves_on():
    resting = MovingBody.at_its_velocity("shelf", Sphere(CENTRE, 0.1))
    np.testing.assert_array_equal(resting.swept_distance(states(), 0.0, 5.0), resting.signed_distance(states(), 2.0))
    rolling = MovingBody.at_its_velocity("ball", Sphere(CENTRE, 0.1, torch.tensor([0.0, 0.1, 0.0])))
    np.testing.assert_allclose(rolling.centre_m(2.0), CENTRE.numpy() + np.array([0, 0.2, 0]), atol=1e-7)


def test_times_and_shapes_that_make_no_motion_are_refused():
    with pytest.raises(ShapeMismatch, match="offsets of waypoints"):
        Waypoints(np.zeros(2), np.zeros((3, 3)))
    with pytest.raises(InvalidSetting, match="one waypoint or more"):
        Waypoints(np.zeros(0), np.zeros((0, 3)))
    with pytest.raises(InvalidSetting, match="times that increase"):
        Waypoints(np.array([1.0, 1.0]), np.zeros((2, 3)))
    with pytest.raises(InvalidSetting, match="finite"):
        Waypoints(np.array([1.0, np.nan]), np.zeros((2, 3)))
    with pytest.raises(ShapeMismatch, match="motion of cup"):
        MovingBody("cup", solids()[0], ConstantVelocity(np.zeros(2)))
    moving = MovingBody("cup", solids()[0], THERE_AND_BACK)
    for samples, horizon_s in ((1, 1.0), (2, -1.0)):
        with pytest.raises(InvalidSetting, match="2 or more"):
            moving.swept_distance(states(), 0.0, horizon_s, samples)
