"""The surface of states that a two-dimensional skill moves on, as a stochastic decoder sees it."""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np
import torch

from geomotion.dynamics.embedded import EmbeddedField
from geomotion.dynamics.fields import Chart
from geomotion.errors import InvalidSetting
from geomotion.manifolds.density import DensityFactor, mean_distance_between
from geomotion.manifolds.grid import LatentGrid
from geomotion.manifolds.grid_metric import metric_on_grid
from geomotion.models import Skill
from geomotion.networks.rbf import RadialBasisNetwork
from geomotion.obstacles.safe_field import PLANE
from geomotion.obstacles.solids import SPACE
from geomotion.types import Float, Tensor

LARGEST_STD = 1.0  # of a coordinate far from the data, in sizes of the demonstrations
SMALLEST_STD = 1e-3  # what the skill explains exactly is still not known better than that
LIKELIHOOD_STEPS = 60
POINTS_OF_A_PATH = 200
POINTS_OF_A_FIT = 2000  # of the spreads
KERNEL_STRIDE = 8  # points of a path for each kernel

Codes = Float[Tensor, "*batch 2"]


@dataclass(frozen=True)
class SkillPlane:
    """The decoder z ↦ ψ⁻¹(z, 0) of a skill, in units of the demonstrations' size.

    Attributes:
        chart: ψ, in double precision.
        coordinates: How many ψ(x) has: those of the skill and others, which vanish in the plane.
        scale_m: Length that becomes one [m].
        position_dim: How many of the first coordinates are a position; obstacles are felt by these.
        precision: Of a decoded coordinate, 1/σ²; None for the mean alone.
    """

    chart: Chart
    coordinates: int
    scale_m: float
    position_dim: int
    precision: RadialBasisNetwork | None = None
    latent_dim: int = PLANE

    def decode(self, z: Codes) -> Float[Tensor, "*batch D"]:
        """States of the skill [m]."""
        return self.chart.to_ambient(torch.cat([z, z.new_zeros(*z.shape[:-1], self.coordinates - PLANE)], dim=-1))

    def positions(self, z: Codes) -> Float[Tensor, "*batch 1 Dx"]:
        """Mean positions [m]."""
        return self.decode(z)[..., None, : self.position_dim]

    def std(self, z: Codes) -> Float[Tensor, "*batch"]:
        """σ of every coordinate, in sizes of the demonstrations."""
        assert self.precision is not None
        std: Tensor = self.precision(z).rsqrt()
        return std

    def blocks(self, z: Codes) -> tuple[Float[Tensor, "*batch 1 P"], Float[Tensor, "*batch Q"]]:
        """Means, and √D σ beside them: once for positions, once for all else, Eq. (3.17)."""
        scaled = self.decode(z) / self.scale_m
        position, rest = scaled[..., : self.position_dim], scaled[..., self.position_dim :]
        if self.precision is not None:
            std = self.std(z)[..., None]
            position = torch.cat([position, self.position_dim**0.5 * std], dim=-1)
            rest = torch.cat([rest, rest.shape[-1] ** 0.5 * std], dim=-1)
        return position[..., None, :], rest


@dataclass(frozen=True)
class SkillSurface:
    """A skill's plane with the demonstrations in it.

    Attributes:
        plane: Decoder with means and spreads.
        codes: Latent points of each training demonstration.
        density: Conformal factor.
        width: Bandwidth of the density.
    """

    plane: SkillPlane
    codes: list[Float[np.ndarray, "_ 2"]]
    density: DensityFactor
    width: float

    @classmethod
    def of(
        cls, skill: Skill, states: Sequence[Float[np.ndarray, "_ D"]], bandwidth: float, power: float
    ) -> "SkillSurface":
        """The surface of a trained skill.

        Args:
            skill: Of two dimensions.
            states: Those of its training demonstrations [m].
            bandwidth: Of the density of demonstrations, times their mean latent distance.
            power: p of the conformal factor.

        Raises:
            InvalidSetting: If the skill has another number of dimensions, or its states are not positions.
        """
        latent = skill.field.field
        found = latent.skill_dim if isinstance(latent, EmbeddedField) else latent.dim
        if found != PLANE:
            raise InvalidSetting("safety", "riemannian", f"a skill of two dimensions, field.skill_dim=2; found {found}")
        if skill.pose is None and skill.state_channels != ("position_m",):
            channels = ", ".join(skill.state_channels)
            raise InvalidSetting("safety", "riemannian", f"states that are positions or poses; found {channels}")
        chart = deepcopy(skill.field).double().eval().requires_grad_(False).chart
        dim = skill.field.dim if skill.pose is None else SPACE
        plane = SkillPlane(chart, latent.dim, skill.geometry.scale_m, dim)
        codes = [chart.to_latent(torch.from_numpy(one))[:, :PLANE] for one in states]
        evenly = [_resampled(one) for one in codes]
        width = bandwidth * mean_distance_between(evenly, [0] * len(evenly))
        density = DensityFactor(torch.cat(evenly), width, power)
        stride = max(1, sum(map(len, codes)) // POINTS_OF_A_FIT)
        some = torch.cat(codes)[::stride]
        residuals = (plane.decode(some) - torch.from_numpy(np.concatenate(states))[::stride]) / plane.scale_m
        centres = torch.cat([one[::KERNEL_STRIDE] for one in evenly])
        known = replace(plane, precision=fitted_precision(some, residuals, centres, width))
        return cls(known, [one.numpy() for one in codes], density, width)

    @torch.no_grad()
    def encoded(self, states: Float[Tensor, "point D"]) -> Float[np.ndarray, "point 2"]:
        """Latent points of states [m]."""
        return np.asarray(self.plane.chart.to_latent(states.double())[:, :PLANE].numpy())

    def grid(self, points_per_axis: int, reach: float) -> LatentGrid:
        """A box around the demonstrations, wider on each side by some widths of their density."""
        every = np.concatenate(self.codes)
        room = reach * self.width
        return LatentGrid(every.min(axis=0) - room, every.max(axis=0) + room, points_per_axis)

    def embedded(self, grid: LatentGrid) -> "EmbeddedGrid":
        """The nodes of a grid, decoded."""
        nodes = torch.from_numpy(grid.nodes)
        position, rest = self.plane.blocks(nodes)
        decoded = self.plane.decode(nodes)[:, : self.plane.position_dim]
        return EmbeddedGrid(grid, decoded.numpy(), position.numpy(), rest.numpy(), self.density(nodes).numpy())


@dataclass(frozen=True)
class EmbeddedGrid:
    """A latent grid with what its nodes decode to.

    Attributes:
        grid: Nodes.
        decoded_m: Mean position at each node [m].
        position: Embedded positions.
        rest: Other embedded coordinates.
        stretch: Conformal factor f.
    """

    grid: LatentGrid
    decoded_m: Float[np.ndarray, "node Dx"]
    position: Float[np.ndarray, "node 1 P"]
    rest: Float[np.ndarray, "node Q"]
    stretch: Float[np.ndarray, " node"]

    def volume(self, factor: Float[np.ndarray, " node"] | None = None) -> Float[np.ndarray, " node"]:
        """√det M at the nodes over that of the means alone, which does not depend on latent coordinates.

        √det M is a density, of which only ratios are functions of the state: whatever chart the surface has, the ratio
        is the same.

        Args:
            factor: Of obstacles at each node, Eq. (3.15); 1 if omitted.
        """
        factors = None if factor is None else factor[None]
        metric = metric_on_grid(self.grid, self.position, self.rest, factors, self.stretch)
        means = metric_on_grid(self.grid, self.position[..., :-1], self.rest[..., :-1])
        return np.asarray(np.sqrt(np.linalg.det(metric) / np.linalg.det(means)))

    def half_edges_m(self) -> Float[np.ndarray, " node"]:
        """Half of the way from each node to its farthest neighbour: as far as what lies between them may be [m]."""
        ends = self.grid.edges
        halves = np.linalg.norm(self.decoded_m[ends[:, 1]] - self.decoded_m[ends[:, 0]], axis=-1) / 2
        farthest = np.zeros(len(self.decoded_m))
        for end in ends.T:
            np.maximum.at(farthest, end, halves)
        return farthest


def _resampled(codes: Float[Tensor, "point 2"]) -> Float[Tensor, "other 2"]:
    """The same path at equal latent distances: where a motion is slow, it is not demonstrated more often."""
    length = np.concatenate([[0.0], codes.diff(dim=0).norm(dim=-1).cumsum(dim=0).numpy()])
    wanted = np.linspace(0.0, length[-1], POINTS_OF_A_PATH)
    return torch.from_numpy(np.stack([np.interp(wanted, length, axis) for axis in codes.numpy().T], axis=1))


def fitted_precision(
    codes: Float[Tensor, "point 2"],
    residuals: Float[Tensor, "point D"],
    centres: Float[Tensor, "kernel 2"],
    bandwidth: float,
) -> RadialBasisNetwork:
    """The likeliest precision of what a decoder misses.

    Args:
        codes: Latent points.
        residuals: Decoded less true states, in the unit of the spread.
        centres: Of the kernels.
        bandwidth: Of the kernels.
    """
    square = residuals.square().mean(dim=-1).clamp(min=SMALLEST_STD**2)
    network = RadialBasisNetwork(len(centres), PLANE, LARGEST_STD**-2).double()
    network.place(centres, bandwidth, float(1 / square.mean()))
    optimiser = torch.optim.LBFGS(network.parameters(), max_iter=LIKELIHOOD_STEPS, line_search_fn="strong_wolfe")

    def negative_log_likelihood() -> Tensor:
        optimiser.zero_grad()
        precision = network(codes)
        loss: Tensor = (precision * square - precision.log()).mean() / 2
        loss.backward()  # type: ignore[no-untyped-call]
        return loss

    optimiser.step(negative_log_likelihood)  # type: ignore[no-untyped-call]
    return network.requires_grad_(False)
