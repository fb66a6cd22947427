"""Convex polygons and polyhedra with rounded corners, in any dimension."""

from itertools import combinations

import numpy as np
import torch

from geomotion.errors import InvalidSetting
from geomotion.obstacles.boundary import convex_hull, deepest_point
from geomotion.obstacles.solids import Solid, length, unit
from geomotion.types import Float, Int, State, Tensor

ROUNDING = 0.1  # of the inradius


class Polytope(Solid):
    r"""The convex hull P of points, and all that is closer to it than the rounding.

    .. math:: \Gamma(x) = (1 + d(x) / r)^2

    with the signed distance d and the inradius r, as for boxes: the distance to a convex set is convex, so Γ grows
    along rays from inside, and C¹ outside that set, so at the surface, which lies a rounding farther out, too. The
    reference point is the Chebyshev centre of P.

    The nearest point of P is looked for on its vertices, edges and faces: the closest of those onto which x projects.
    Time and memory grow with their number.

    Args:
        vertices: The points [m].
        rounding: Radius of corners and edges, by which the body is larger than P [m]; a tenth of the inradius of P if
            omitted.
        velocity: Shape (D,) [m/s].

    Raises:
        InvalidSetting: If the points lie in one plane, or the rounding is not positive.
    """

    normals: Tensor
    offsets: Tensor
    corners: Tensor
    shares: Tensor
    constants: Tensor
    residuals: Tensor
    feet: Tensor

    def __init__(
        self, vertices: Float[np.ndarray, "point D"], rounding: float | None = None, velocity: Tensor | None = None
    ) -> None:
        hull = convex_hull(vertices)
        normals, offsets = hull.equations[:, :-1], -hull.equations[:, -1]
        centre, depth = deepest_point(normals, offsets)
        super().__init__(torch.from_numpy(centre), velocity=velocity)
        self.rounding = ROUNDING * depth if rounding is None else rounding
        if not self.rounding > 0:
            raise InvalidSetting("obstacle.rounding_m", rounding, "a length above 0")
        self.inradius = depth + self.rounding
        outer = vertices[hull.vertices]
        self.bounding_radius = float(np.linalg.norm(outer - centre, axis=1).max()) + self.rounding
        self.register_buffer("normals", torch.from_numpy(normals))
        self.register_buffer("offsets", torch.from_numpy(offsets - normals @ centre))
        corners, shares, constants = _features(vertices - centre, hull.simplices)
        self.register_buffer("corners", torch.from_numpy(corners))
        self.register_buffer("shares", torch.from_numpy(shares))
        self.register_buffer("constants", torch.from_numpy(constants))
        residuals = np.eye(len(centre)) - np.einsum("fkd,fke->fde", corners, shares)
        self.register_buffer("residuals", torch.from_numpy(residuals))
        self.register_buffer("feet", torch.from_numpy(np.einsum("fkd,fk->fd", corners, constants)))

    def signed_distance(self, x: State) -> Float[Tensor, "*batch"]:
        body = self.to_body(x)
        depth = self._heights(body).amax(dim=-1)
        beyond = length(body - self._nearest(body))[..., 0]
        return torch.where(depth > 0, beyond, depth) - self.rounding

    def level(self, x: State) -> Float[Tensor, "*batch"]:
        return (1 + self.signed_distance(x) / self.inradius).square()

    def normal(self, x: State) -> State:
        body = self.to_body(x)
        height, face = self._heights(body).max(dim=-1)
        return torch.where(height[..., None] > 0, unit(body - self._nearest(body)), self.normals[face])

    def _heights(self, body: State) -> Float[Tensor, "*batch face"]:
        """Above the planes of the faces [m]."""
        heights: Tensor = body @ self.normals.T - self.offsets
        return heights

    def _nearest(self, body: State) -> State:
        """The point of P nearest to a state outside, by its projections onto P's features."""
        with torch.no_grad():
            is_beside = torch.zeros_like(body[..., :1], dtype=torch.bool)
            squares = torch.zeros_like(body[..., :1])
            for corner in range(self.dim):  # loops over few, for sums along a short last axis are slow
                is_beside = is_beside | (body @ self.shares[:, corner].T + self.constants[:, corner] < 0)
            for axis in range(self.dim):
                squares = squares + (body @ self.residuals[:, axis].T - self.feet[:, axis]).square()
            chosen = squares.masked_fill(is_beside, torch.inf).argmin(dim=-1)
        weights = (self.shares[chosen] @ body[..., None])[..., 0] + self.constants[chosen]
        return (weights[..., None] * self.corners[chosen]).sum(dim=-2)


def _features(
    vertices: Float[np.ndarray, "point D"], simplices: Int[np.ndarray, "face D"]
) -> tuple[Float[np.ndarray, "feature D D"], Float[np.ndarray, "feature D D"], Float[np.ndarray, "feature D"]]:
    """Corners of every vertex, edge, … and face, and the affine map from a state to the weights of its projection.

    Features of fewer than D corners are filled up with corners of weight zero.
    """
    dim = vertices.shape[1]
    corners, shares, constants = [], [], []
    for count in range(1, dim + 1):
        subsets = np.concatenate([simplices[:, chosen] for chosen in combinations(range(dim), count)])
        for subset in np.unique(np.sort(subsets, axis=1), axis=0):
            base, spanned = vertices[subset[0]], vertices[subset[1:]] - vertices[subset[0]]
            others = np.linalg.pinv(spanned.T) if count > 1 else np.zeros((0, dim))
            share = np.concatenate([-others.sum(axis=0, keepdims=True), others, np.zeros((dim - count, dim))])
            corners.append(np.concatenate([vertices[subset], np.zeros((dim - count, dim))]))
            shares.append(share)
            constants.append(np.eye(dim)[0] - share @ base)
    return np.stack(corners), np.stack(shares), np.stack(constants)
