"""Point clouds against spheres and brute force."""

import numpy as np
import pytest
import torch

from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.obstacles.body import Body
from geomotion.obstacles.point_cloud import PointCloud
from geomotion.obstacles.solids import Sphere

RADIUS = 0.03


def points(count: int = 300, dim: int = 3) -> np.ndarray:
    return np.random.default_rng(count).uniform(-0.2, 0.2, size=(count, dim))


def states(count: int = 3000, size: float = 1.0, dim: int = 3) -> np.ndarray:
    return size * (np.random.default_rng(1).random((count, dim)) - 0.5)


def brute_force(cloud: np.ndarray, x: np.ndarray) -> np.ndarray:
    return np.linalg.norm(x[:, None] - cloud, axis=-1).min(axis=1) - RADIUS


@pytest.mark.parametrize("dim", [2, 3])
def test_a_cloud_of_one_point_is_a_sphere(dim):
    centre = np.array([0.1, -0.2, 0.3])[:dim]
    cloud, ball = PointCloud(centre[None], RADIUS), Sphere(torch.from_numpy(centre), RADIUS)
    x = torch.from_numpy(centre + states(size=0.3, dim=dim))
    lost = ball.signed_distance(x) - cloud.signed_distance(x)
    assert isinstance(cloud, Body)
    assert lost.min() > -1e-12
    assert lost.max() < cloud.step / 3
    assert (cloud.inradius, cloud.bounding_radius) == (ball.inradius, ball.bounding_radius)
    torch.testing.assert_close(cloud.reference, ball.reference)


@pytest.mark.parametrize("dim", [2, 3])
def test_near_the_surface_a_distance_is_exact_and_farther_away_never_too_large(dim):
    cloud = PointCloud(points(dim=dim), RADIUS)
    for size in (0.4, 0.8, 3.0):
        found = cloud.signed_distance(torch.from_numpy(states(size=size, dim=dim))).numpy()
        expected = brute_force(points(dim=dim), states(size=size, dim=dim))
        is_near = expected + RADIUS < 1.5 * cloud.step
        np.testing.assert_allclose(found[is_near], expected[is_near], atol=1e-14)
        assert (found <= expected + 1e-14).all()
        if size < 0.8:
            assert (expected - found).max() < 1.1 * cloud.step
            assert is_near.mean() > 0.05


@pytest.mark.parametrize("spread", [0.01, 5.0])
def test_a_cloud_of_any_size_is_served(spread):
    cloud = spread * points()
    x = 3 * spread * states()
    found = PointCloud(cloud, RADIUS).signed_distance(torch.from_numpy(x)).numpy()
    assert np.isfinite(found).all()
    assert (found <= brute_force(cloud, x) + 1e-12).all()


def test_distances_change_no_faster_than_the_state_moves_but_for_the_error_of_the_grid():
    cloud = PointCloud(points(), RADIUS)
    x = torch.from_numpy(states())
    for move in (1e-3, 0.03, 0.3):
        y = x + move * torch.from_numpy(states(size=1.0)).flip(0)
        change = (cloud.signed_distance(x) - cloud.signed_distance(y)).abs()
        is_exact = (cloud.signed_distance(x) + RADIUS < cloud.step) & (cloud.signed_distance(y) + RADIUS < cloud.step)
        allowed = torch.where(is_exact, 1e-12, 1.1 * cloud.step)
        is_covered = (x.abs() < 0.39).all(dim=-1) & (y.abs() < 0.39).all(dim=-1)
        assert (change <= (x - y).norm(dim=-1) + allowed)[is_covered].all()


def test_the_bounding_ball_holds_every_ball():
    cloud = PointCloud(points(), RADIUS)
    reach = np.linalg.norm(points() - cloud.reference.numpy(), axis=1).max() + RADIUS
    np.testing.assert_allclose(cloud.bounding_radius, reach)
    assert (cloud.signed_distance(cloud.reference[None]) <= -RADIUS + 1e-15).all()


def test_any_batch_shape_and_precision_are_served():
    x = torch.from_numpy(states(24)).reshape(2, 3, 4, 3).float()
    found = PointCloud(points(), RADIUS).signed_distance(x)
    assert (found.shape, found.dtype) == ((2, 3, 4), torch.float32)
    single = PointCloud(points(), RADIUS).float().signed_distance(x)
    torch.testing.assert_close(single, found, atol=1e-4, rtol=0)


def test_what_makes_no_cloud_is_refused():
    with pytest.raises(InvalidSetting, match=r"cloud\.points=none"):
        PointCloud(np.zeros((0, 3)), RADIUS)
    with pytest.raises(InvalidSetting, match="2 of 300 not finite"):
        PointCloud(np.where(np.arange(300)[:, None] < 2, np.nan, points()), RADIUS)
    with pytest.raises(InvalidSetting, match=r"cloud\.radius=0"):
        PointCloud(points(), 0.0)
    with pytest.raises(InvalidSetting, match=r"cloud\.margin_m"):
        PointCloud(points(), RADIUS, margin_m=-1.0)
    with pytest.raises(ShapeMismatch, match="2 or 3, found 4"):
        PointCloud(points(dim=4), RADIUS)
