"""Vectors of poses: bijective inside the cover, with the right twist."""

import math

import pytest
import torch

from geomotion.lie.poses import CoverName, Group, PoseCoordinates
from geomotion.lie.rotations import inverse, product, quaternion, rotation_vector

REFERENCE = quaternion(torch.tensor([0.3, -1.0, 0.5], dtype=torch.float64))


def coordinates(group: Group = "SO3", cover: CoverName = "radial") -> PoseCoordinates:
    return PoseCoordinates(REFERENCE, 0.3, group, cover)


def poses(spread_rad: float) -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(0)
    turns = torch.randn(100, 3, generator=generator, dtype=torch.float64)
    turns = spread_rad * turns / turns.norm(dim=-1, keepdim=True) * torch.rand(100, 1, generator=generator).double()
    return torch.rand(100, 3, generator=generator, dtype=torch.float64), product(quaternion(turns), REFERENCE)


@pytest.mark.parametrize("cover", ["radial", "cube"])
@pytest.mark.parametrize(("group", "spread"), [("SO3", 3.0), ("S3", 6.0)])
def test_there_and_back(group: Group, cover: CoverName, spread: float) -> None:
    position, orientation = poses(spread)
    chart = coordinates(group, cover)
    again = chart.to_pose(chart.to_vector(position, orientation))
    torch.testing.assert_close(again[0], position)
    torch.testing.assert_close(again[1], orientation, rtol=0, atol=1e-7)


def test_signs_of_quaternions_matter_in_s3_alone() -> None:
    position, orientation = poses(1.0)
    same, other = (coordinates(group) for group in ("SO3", "S3"))
    torch.testing.assert_close(same.to_vector(position, -orientation), same.to_vector(position, orientation))
    apart = other.to_vector(position, -orientation) - other.to_vector(position, orientation)
    assert float(apart.norm(dim=-1).min()) > 0.3 * math.pi


@pytest.mark.parametrize("cover", ["radial", "cube"])
def test_twist_is_how_fast_the_pose_moves(cover: CoverName) -> None:
    chart, step = coordinates(cover=cover), 1e-6
    x = chart.to_vector(*poses(2.5))
    velocity = torch.randn(x.shape, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    (_, before), (_, after) = (chart.to_pose(x + sign * step * velocity) for sign in (-1, 1))
    twist = chart.twist(x, velocity)
    turned = rotation_vector(product(after, inverse(before))) / (2 * step)
    torch.testing.assert_close(twist.omega, turned, rtol=1e-5, atol=1e-6)
    torch.testing.assert_close(twist.velocity, velocity[:, :3])


def test_whatever_the_vector_it_is_a_pose() -> None:
    far = 100 * torch.randn(50, 6, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    chart = coordinates()
    _, orientation = chart.to_pose(far)
    torch.testing.assert_close(orientation.norm(dim=-1), torch.ones(50, dtype=torch.float64))
    assert float(chart.turned_from_reference(orientation).norm(dim=-1).max()) <= math.pi * (1 + 1e-12)


def test_document_makes_it_again() -> None:
    chart = coordinates("S3", "cube")
    again = PoseCoordinates.from_document(chart.document())
    torch.testing.assert_close(again.to_vector(*poses(1.0)), chart.to_vector(*poses(1.0)))
