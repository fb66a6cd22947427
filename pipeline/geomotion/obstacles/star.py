"""Star-shaped polygons and meshes, with a surface smooth enough for a field to flow around."""

from itertools import product

import numpy as np
import torch
from scipy.spatial import cKDTree

from geomotion.errors import InvalidSetting
from geomotion.obstacles.boundary import Boundary, deepest_point
from geomotion.obstacles.solids import Solid, length, unit
from geomotion.types import Float, Int, State, Tensor

CELLS = {2: 32, 3: 24}  # steps of the grid of log radii, along the radius of the unit sphere
ANGLE = {2: 1 / 500, 3: 1 / 100}  # between samples of the surface [rad]
GROWN_ANGLE = {2: 1 / 200, 3: 1 / 30}  # the same of a body that is grown, for which each one is held against all others
AT_ONCE = 1000  # samples
MARGIN = 4  # steps of the grid beyond the cube around the sphere
VISIBLE = 1e-4  # of the size: a kernel less deep is a point that rounding decides about


class StarShape(Solid):
    r"""A body that every ray from its reference point leaves once, and the smooth one around it that is avoided.

    .. math:: \Gamma(x) = \big(\|x - c\|\, e^{-h(u)}\big)^2, \qquad u = \frac{x - c}{\|x - c\|}

    h is the logarithm of a smooth radius. Γ grows along every ray like the square of the distance, whatever h is, so
    the surface is star-shaped by construction, and Γ is as smooth as h. A signed distance would not do: around a
    concave body it has ridges where the nearest point jumps.

    The log radius of the body has kinks at its edges. h replaces it by quadratic B-splines on a grid of the cube around
    the unit sphere: C¹, the same in two and three dimensions, without poles, and at constant cost. They are fitted to
    samples of the surface and then raised where they fall short. B-splines are positive and add up to one, so raising
    all coefficients around a sample by what it lacks, and by what the body may gain up to the next sample, is enough:
    the avoided body contains the given one. ``growth`` says by how much it is larger.

    The reference point is the deepest one of the kernel, from where all of the surface can be seen.

    Args:
        boundary: The surface of the body.
        velocity: Shape (D,) [m/s].
        grown_by: What is nearer to the body than this counts as a part of it [m].

    Attributes:
        growth: Largest ratio of avoided to given (and grown) radius, less one.

    Raises:
        InvalidSetting: If the body is not star-shaped.
    """

    coefficients: Tensor

    def __init__(self, boundary: Boundary, velocity: Tensor | None = None, grown_by: float = 0.0) -> None:
        centre, depth = deepest_point(boundary.normals, boundary.offsets)
        if not depth > VISIBLE * float(np.ptp(boundary.vertices, axis=0).max()):
            raise InvalidSetting(
                "obstacle",
                "a body without a point from which all of its surface can be seen",
                "a star-shaped one; avoid its convex hull with obstacle.convex_hull=true, or cut it into star-shaped "
                "pieces that do not touch, obstacle=several",
            )
        super().__init__(torch.from_numpy(centre), velocity=velocity)
        self.step = 1 / CELLS[self.dim]
        angle = (GROWN_ANGLE if grown_by > 0 else ANGLE)[self.dim]
        offsets, faces = boundary.samples(centre, angle)
        offsets = offsets - centre
        radii = np.linalg.norm(offsets, axis=1)
        directions = torch.from_numpy(offsets / radii[:, None])
        heights = (boundary.offsets - boundary.normals @ centre)[faces]
        if grown_by > 0:
            # grown, it is star-shaped about every point of the ball in its kernel, grown as well
            radii, heights = _grown_radii(offsets, grown_by + angle * radii), np.full_like(radii, depth + grown_by)
        slopes = np.sqrt(np.maximum((radii / heights) ** 2 - 1, 0))
        self.register_buffer("coefficients", self._interpolate(directions, np.log(radii)))
        lacking = np.log(radii) - self._log_radius(directions).numpy()
        self._raise(directions, lacking + 2 * slopes * angle)
        smooth = self._log_radius(directions).exp().numpy()
        self.growth = float((smooth / radii).max()) - 1
        steepest = self._slope_bound()
        self.steepness = float(np.hypot(1, steepest))
        self.inradius = float(radii.min())
        self.bounding_radius = float(smooth.max() * np.exp(steepest * angle))

    def level(self, x: State) -> Float[Tensor, "*batch"]:
        body = self.to_body(x)
        return (length(body)[..., 0] * (-self._log_radius(unit(body))).exp()).square()

    def normal(self, x: State) -> State:
        direction = unit(self.to_body(x))
        slope = self._gradient(direction)
        return unit(direction - slope + (slope * direction).sum(dim=-1, keepdim=True) * direction)

    def signed_distance(self, x: State) -> Float[Tensor, "*batch"]:
        """At least that far, outside; inside, along the ray.

        log Γ changes by at most 2k/‖x - c‖ per metre with k² = 1 + max ‖∇h‖², so no point of the surface is closer
        than ‖x - c‖ (1 - Γ^{-1/2k}): exact for balls, at the surface too small by up to k.
        """
        radius, level = length(self.to_body(x))[..., 0], self.level(x)
        outside = torch.maximum(radius * (1 - level ** (-0.5 / self.steepness)), radius - self.bounding_radius)
        inside = radius - self._log_radius(unit(self.to_body(x))).exp()
        return torch.where(level > 1, outside, inside.clamp(max=0))

    def _log_radius(self, direction: State) -> Float[Tensor, "*batch"]:
        block, weights, _ = self._splines(direction)
        return _contract(block, [weights[..., axis, :] for axis in range(self.dim)])

    def _gradient(self, direction: State) -> State:
        """∇h in the cube, with its part along the direction."""
        block, weights, slopes = self._splines(direction)
        parts = [
            _contract(block, [(slopes if axis == along else weights)[..., axis, :] for axis in range(self.dim)])
            for along in range(self.dim)
        ]
        return torch.stack(parts, dim=-1)

    def _splines(self, direction: State) -> tuple[Tensor, Tensor, Tensor]:
        """Coefficients around a direction (3 along each axis), and of each axis the weights and their slopes."""
        index, share = self._place(direction)
        t = share[..., None]
        weights = torch.cat([(0.5 - t).square() / 2, 0.75 - t.square(), (0.5 + t).square() / 2], dim=-1)
        slopes = torch.cat([t - 0.5, -2 * t, t + 0.5], dim=-1) / self.step
        width = self.coefficients.shape[0]
        strides = width ** torch.arange(self.dim - 1, -1, -1)
        block = torch.tensor(list(product((-1, 0, 1), repeat=self.dim))) @ strides
        found = self.coefficients.take((index @ strides)[..., None] + block)
        return found.reshape(*index.shape[:-1], *(3,) * self.dim), weights, slopes

    def _place(self, direction: State) -> tuple[Int[Tensor, "*batch D"], State]:
        """The nearest node, and where the direction is beside it, in steps."""
        place = (direction.nan_to_num() + 1) / self.step + MARGIN
        index = place.detach().round().long()
        return index, place - index

    def _interpolate(
        self, directions: Float[Tensor, "sample D"], log_radii: Float[np.ndarray, " sample"]
    ) -> Float[Tensor, "*grid"]:
        """Coefficients equal to the log radius towards their nodes, as far as these are near the sphere."""
        axis = (np.arange(2 * CELLS[self.dim] + 1 + 2 * MARGIN) - MARGIN) * self.step - 1
        nodes = np.stack(np.meshgrid(*[axis] * self.dim, indexing="ij"), axis=-1)
        radius = np.linalg.norm(nodes, axis=-1)
        self.is_used = np.abs(radius - 1) < 2 * np.sqrt(self.dim) * self.step
        coefficients = np.zeros(radius.shape)
        nearest = cKDTree(directions.numpy()).query(nodes[self.is_used] / radius[self.is_used][:, None])[1]
        coefficients[self.is_used] = log_radii[nearest]
        return torch.from_numpy(coefficients)

    def _raise(self, directions: Float[Tensor, "sample D"], lacking: Float[np.ndarray, " sample"]) -> None:
        """Raise each coefficient by the most that a sample in its reach lacks."""
        index, _ = self._place(directions)
        missing = np.zeros(self.coefficients.shape)
        for offset in product((-1, 0, 1), repeat=self.dim):
            nodes = tuple(index[:, axis].numpy() + o for axis, o in enumerate(offset))
            np.maximum.at(missing, nodes, lacking)
        self.coefficients += torch.from_numpy(missing)

    def _slope_bound(self) -> float:
        """Upper bound of ‖∇h‖: derivatives of B-splines are means of differences of neighbouring coefficients."""
        both = [
            (np.diff(self.coefficients.numpy(), axis=axis), np.logical_and(*_pairs(self.is_used, axis)))
            for axis in range(self.dim)
        ]
        return float(np.linalg.norm([np.abs(differences[used]).max() / self.step for differences, used in both]))


def _grown_radii(
    offsets: Float[np.ndarray, "sample D"], by: Float[np.ndarray, " sample"]
) -> Float[np.ndarray, " sample"]:
    """How far rays through samples are in balls around any of them, whose radii are given."""
    directions = offsets / np.linalg.norm(offsets, axis=1, keepdims=True)
    beyond = np.square(by) - np.square(offsets).sum(axis=1)
    found = []
    for some in np.split(directions, range(AT_ONCE, len(directions), AT_ONCE)):
        along = some @ offsets.T
        inside = np.square(along) + beyond
        found.append(np.where(inside >= 0, along + np.sqrt(inside.clip(min=0)), 0.0).max(axis=1))
    return np.concatenate(found)


def _pairs(mask: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    count = mask.shape[axis]
    return mask.take(range(count - 1), axis=axis), mask.take(range(1, count), axis=axis)


def _contract(block: Tensor, factors: list[Tensor]) -> Tensor:
    """Σ over the last axes of a block with one factor for each."""
    for factor in reversed(factors):
        between = block.ndim - factor.ndim
        block = (block * factor.reshape(*factor.shape[:-1], *(1,) * between, 3)).sum(dim=-1)
    return block
