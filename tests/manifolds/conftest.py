"""Decoders with known geometry."""

import pytest
import torch
from torch import Tensor, nn


class SphereDecoder:
    """Polar and azimuthal angle to a sphere; the other block is empty but for a constant."""

    latent_dim = 2

    def __init__(self, radius: float = 1.0) -> None:
        self.radius = radius

    def positions(self, z: Tensor) -> Tensor:
        polar, azimuth = z.unbind(dim=-1)
        point = torch.stack([polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos()], dim=-1)
        return self.radius * point[..., None, :]

    def blocks(self, z: Tensor) -> tuple[Tensor, Tensor]:
        return self.positions(z), torch.zeros_like(z[..., :1])


class RandomDecoder:
    """A small network for each position and one for everything else, scaled."""

    def __init__(self, latent_dim: int = 2, scale: float = 1.0, seed: int = 0, positions: int = 1) -> None:
        torch.manual_seed(seed)
        self.latent_dim, self.scale = latent_dim, scale
        self.networks = [
            nn.Sequential(nn.Linear(latent_dim, 16), nn.Tanh(), nn.Linear(16, outputs)).double().requires_grad_(False)
            for outputs in (*[3] * positions, 5)
        ]

    def positions(self, z: Tensor) -> Tensor:
        return self.scale * torch.stack([network(z) for network in self.networks[:-1]], dim=-2)

    def blocks(self, z: Tensor) -> tuple[Tensor, Tensor]:
        return self.positions(z), self.scale * self.networks[-1](z)


@pytest.fixture
def sphere() -> type[SphereDecoder]:
    return SphereDecoder


@pytest.fixture
def random_decoder() -> type[RandomDecoder]:
    return RandomDecoder
