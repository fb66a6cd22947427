"""Both covers are bijections with the ball; the radial one is smooth, the cube one has the kinks of Eq. (6.4)."""

import math

import pytest
import torch

from geomotion.lie.cover import Cover, CubeCover, RadialCover

COVERS = (RadialCover(math.pi), CubeCover(math.pi))


def vectors(size: float, count: int = 200) -> torch.Tensor:
    return size * torch.randn(count, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)


@pytest.mark.parametrize("cover", COVERS)
@pytest.mark.parametrize("size", [1e-7, 0.1, 2.0])
def test_there_and_back(cover: Cover, size: float) -> None:
    flat = vectors(size)
    inside = cover.to_ball(flat)
    assert float(inside.norm(dim=-1).max()) < math.pi
    torch.testing.assert_close(cover.to_flat(inside), flat, rtol=1e-6, atol=0)


@pytest.mark.parametrize("cover", COVERS)
def test_nothing_leaves_the_ball(cover: Cover) -> None:
    assert float(cover.to_ball(vectors(1e6)).norm(dim=-1).max()) <= math.pi * (1 + 1e-12)


@pytest.mark.parametrize("cover", COVERS)
@pytest.mark.parametrize("size", [1e-3, 0.3, 3.0])
def test_push_is_the_derivative(cover: Cover, size: float) -> None:
    flat, tangent = vectors(size), vectors(1.0).flip(0)
    _, expected = torch.func.jvp(cover.to_ball, (flat,), (tangent,))
    torch.testing.assert_close(cover.push(flat, tangent), expected, rtol=1e-6, atol=1e-9)


def test_radial_cover_is_the_identity_near_the_centre() -> None:
    cover = RadialCover(math.pi)
    zero, tangent = torch.zeros(1, 3), torch.tensor([[1.0, 2.0, 3.0]])
    torch.testing.assert_close(cover.push(zero, tangent), tangent)
    torch.testing.assert_close(cover.to_ball(1e-3 * tangent), 1e-3 * tangent, rtol=1e-5, atol=0)


def test_cube_cover_is_that_of_the_thesis() -> None:
    flat = vectors(1.0)
    box = (flat / math.pi).tanh()
    expected = math.pi * box.abs().amax(-1, keepdim=True) / box.norm(dim=-1, keepdim=True) * box
    torch.testing.assert_close(CubeCover(math.pi).to_ball(flat), expected)


def test_cube_cover_has_a_cone_at_the_centre() -> None:
    """Along an axis it grows as fast as its argument, along a diagonal 1/√3 as fast."""
    small = torch.tensor([[1e-5, 0, 0], [1e-5 / math.sqrt(3)] * 3], dtype=torch.float64)
    gains = CubeCover(math.pi).to_ball(small).norm(dim=-1) / small.norm(dim=-1)
    torch.testing.assert_close(gains, torch.tensor([1, 1 / math.sqrt(3)], dtype=torch.float64), rtol=1e-6, atol=0)
