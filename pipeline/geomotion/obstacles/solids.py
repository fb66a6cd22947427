"""Spheres, ellipsoids and boxes in any dimension; each one's reference point is its centre."""

import math
from collections.abc import Sequence

import torch
from torch import nn

from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.types import Float, State, Tensor

SPACE = 3
NEWTON_STEPS = 20  # from a start above the root of a convex function; eight suffice for axes of ratio 100


class Solid(nn.Module):
    """Place, orientation and velocity of a body.

    Args:
        centre: Shape (D,) [m].
        rotation: The body's axes as columns, shape (D, D); those of the state if omitted.
        velocity: Shape (D,) [m/s]; at rest if omitted.

    Raises:
        ShapeMismatch: If their dimensions differ.
    """

    reference: Tensor
    rotation: Tensor
    velocity: Tensor

    def __init__(self, centre: Tensor, rotation: Tensor | None = None, velocity: Tensor | None = None) -> None:
        super().__init__()
        self.dim = centre.shape[0]
        rotation = torch.eye(self.dim) if rotation is None else rotation
        velocity = torch.zeros(self.dim) if velocity is None else velocity
        for name, value, shape in (("rotation", rotation, (self.dim, self.dim)), ("velocity", velocity, (self.dim,))):
            if value.shape != shape:
                raise ShapeMismatch(f"{name} of an obstacle in {self.dim} dimensions", shape, tuple(value.shape))
        self.register_buffer("reference", centre.clone())
        self.register_buffer("rotation", rotation.to(centre))
        self.register_buffer("velocity", velocity.to(centre))

    def to_body(self, x: State) -> State:
        """Coordinates in the body's frame [m]."""
        return (x - self.reference) @ self.rotation

    def to_world(self, direction: State) -> State:
        """A direction of the body's frame in the coordinates of the state."""
        return direction @ self.rotation.T


class Sphere(Solid):
    """A ball.

    Args:
        centre: Shape (D,) [m].
        radius: [m].
        velocity: Shape (D,) [m/s].
    """

    def __init__(self, centre: Float[Tensor, " D"], radius: float, velocity: Tensor | None = None) -> None:
        super().__init__(centre, velocity=velocity)
        _require_lengths("radius", (radius,))
        self.inradius = self.bounding_radius = radius

    def signed_distance(self, x: State) -> Float[Tensor, "*batch"]:
        return length(x - self.reference)[..., 0] - self.inradius

    def level(self, x: State) -> Float[Tensor, "*batch"]:
        return ((x - self.reference) / self.inradius).square().sum(dim=-1)

    def normal(self, x: State) -> State:
        return unit(x - self.reference)


class Ellipsoid(Solid):
    """A ball stretched along its axes; Γ is the quadratic form that is one at the surface.

    Args:
        centre: Shape (D,) [m].
        semi_axes: Half lengths along its axes [m].
        rotation: Its axes as columns, shape (D, D).
        velocity: Shape (D,) [m/s].
    """

    semi_axes: Tensor

    def __init__(
        self,
        centre: Float[Tensor, " D"],
        semi_axes: Sequence[float],
        rotation: Tensor | None = None,
        velocity: Tensor | None = None,
    ) -> None:
        super().__init__(centre, rotation, velocity)
        _require_lengths("semi_axes", semi_axes, self.dim)
        self.register_buffer("semi_axes", torch.tensor(semi_axes, dtype=centre.dtype))
        self.inradius, self.bounding_radius = min(semi_axes), max(semi_axes)

    def signed_distance(self, x: State) -> Float[Tensor, "*batch"]:
        """Exact; its first derivative is exact, too, its second is not.

        The nearest point p obeys y - p = t p/a², so t solves Σ (aᵢ yᵢ / (t + aᵢ²))² = 1. Newton's method climbs to
        the largest solution without overshooting, because the left side is convex and falls.
        """
        squares = self.semi_axes.square()
        stretch = squares - squares.min()
        scaled = self.to_body(x).abs() * self.semi_axes
        # off the plane across the shortest axis, where inside points have two nearest ones
        scaled = scaled.clamp(min=torch.finfo(x.dtype).tiny ** 0.25 * squares.min())
        with torch.no_grad():
            shift = (scaled - stretch).amax(dim=-1, keepdim=True)
            for _ in range(NEWTON_STEPS):
                before, shift = shift, _newton_step(shift, scaled, stretch)
                if torch.allclose(before, shift, rtol=torch.finfo(x.dtype).eps ** 0.5, atol=0):
                    break  # the next step, below, leaves an error of about eps
        shift = _newton_step(shift, scaled, stretch)  # differentiated: the derivative of an implicit function
        slope = scaled / ((shift + stretch) * self.semi_axes)
        return ((shift - squares.min()) * length(slope))[..., 0]

    def level(self, x: State) -> Float[Tensor, "*batch"]:
        return (self.to_body(x) / self.semi_axes).square().sum(dim=-1)

    def normal(self, x: State) -> State:
        return unit(self.to_world(self.to_body(x) / self.semi_axes.square()))


class Box(Solid):
    r"""A box with rounded edges and corners.

    .. math:: \Gamma(x) = (1 + d(x) / r)^2

    with d the signed distance and r half of the shortest side. Γ grows along rays from the centre, because d is
    convex, and it is C¹ outside the box that remains when the rounding is taken off, so at the surface, too.

    Args:
        centre: Shape (D,) [m].
        sides: Full lengths, the rounding included [m].
        rounding: Radius of edges and corners [m], above zero and at most half of the shortest side.
        rotation: Its axes as columns, shape (D, D).
        velocity: Shape (D,) [m/s].
    """

    core: Tensor

    def __init__(
        self,
        centre: Float[Tensor, " D"],
        sides: Sequence[float],
        rounding: float,
        rotation: Tensor | None = None,
        velocity: Tensor | None = None,
    ) -> None:
        super().__init__(centre, rotation, velocity)
        _require_lengths("sides", sides, self.dim)
        self.inradius = min(sides) / 2
        if not 0 < rounding <= self.inradius:
            raise InvalidSetting("rounding", rounding, f"more than 0 and at most half of the shortest side of {sides}")
        self.rounding = rounding
        self.register_buffer("core", torch.tensor(sides, dtype=centre.dtype) / 2 - rounding)
        self.bounding_radius = math.hypot(*(side / 2 - rounding for side in sides)) + rounding

    def signed_distance(self, x: State) -> Float[Tensor, "*batch"]:
        beyond = self.to_body(x).abs() - self.core
        return length(beyond.clamp(min=0))[..., 0] + beyond.amax(dim=-1).clamp(max=0) - self.rounding

    def level(self, x: State) -> Float[Tensor, "*batch"]:
        return (1 + self.signed_distance(x) / self.inradius).square()

    def normal(self, x: State) -> State:
        body = self.to_body(x)
        beyond = body.abs() - self.core
        deepest = torch.eye(self.dim).to(x)[beyond.argmax(dim=-1)]
        is_in_core = (beyond <= 0).all(dim=-1, keepdim=True)
        outward = torch.where(is_in_core, deepest, beyond.clamp(min=0))
        return unit(self.to_world(torch.where(body < 0, -outward, outward)))


def unit(vector: State) -> State:
    """The vector at length one; zero stays zero."""
    return vector / length(vector).clamp(min=torch.finfo(vector.dtype).tiny)


def length(vector: State) -> Float[Tensor, "*batch 1"]:
    """The Euclidean norm; its gradient at zero is zero."""
    found: Tensor = vector.norm(dim=-1, keepdim=True)
    return found


def _newton_step(shift: Tensor, scaled: Tensor, stretch: Tensor) -> Tensor:
    terms = (scaled / (shift + stretch)).square()
    ones = torch.ones(terms.shape[-1], 1).to(terms)  # ten times as fast as a sum over so few coordinates
    return shift + (terms @ ones - 1) / (2 * (terms / (shift + stretch)) @ ones)


def _require_lengths(name: str, lengths: Sequence[float], count: int = 1) -> None:
    if len(lengths) != count:
        raise ShapeMismatch(f"{name} of an obstacle", f"{count} lengths", lengths)
    if min(lengths) <= 0:
        raise InvalidSetting(name, lengths, "lengths above 0")
