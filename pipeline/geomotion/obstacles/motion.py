"""Bodies that move along given paths, without turning."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol, runtime_checkable

import numpy as np
import torch

from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.obstacles.body import Body
from geomotion.types import Float

Vector = Float[np.ndarray, " D"]
Points = Float[np.ndarray, "point D"]
EXACT_WITHIN_M = 0.15  # more than a tool's size and the clearance that it keeps


@runtime_checkable
class Motion(Protocol):
    """How far a body has moved from where its reference point says."""

    def offset(self, time_s: float) -> Vector:
        """Displacement since time zero [m]."""
        ...

    def velocity(self, time_s: float) -> Vector:
        """[m/s]."""
        ...

    def travelled(self, start_s: float, end_s: float) -> float:
        """Length of the way between two times [m]."""
        ...


@dataclass(frozen=True)
class ConstantVelocity:
    """Straight on, before time zero too."""

    velocity_m_per_s: Vector

    def offset(self, time_s: float) -> Vector:
        return self.velocity_m_per_s * time_s

    def velocity(self, time_s: float) -> Vector:
        return self.velocity_m_per_s

    def travelled(self, start_s: float, end_s: float) -> float:
        return float(np.linalg.norm(self.velocity_m_per_s)) * (end_s - start_s)


@dataclass(frozen=True)
class Waypoints:
    """From one waypoint to the next at constant velocity; at the first before it starts, and at the last for ever.

    Attributes:
        times_s: Increasing.
        offsets_m: Displacements at these times, from where the body's reference point says.

    Raises:
        ShapeMismatch: If times and offsets differ in number.
        InvalidSetting: If there are none, times do not increase, or a number is not finite.
    """

    times_s: Float[np.ndarray, " waypoint"]
    offsets_m: Float[np.ndarray, "other_waypoint D"]

    def __post_init__(self) -> None:
        if len(self.times_s) != len(self.offsets_m):
            raise ShapeMismatch("offsets of waypoints", len(self.times_s), len(self.offsets_m))
        if len(self.times_s) == 0:
            raise InvalidSetting("motion.times_s", "none", "one waypoint or more")
        if not (np.isfinite(self.times_s).all() and np.isfinite(self.offsets_m).all()):
            raise InvalidSetting("motion", "NaN or infinity", "finite times and offsets")
        if (np.diff(self.times_s) <= 0).any():
            raise InvalidSetting("motion.times_s", self.times_s.tolist(), "times that increase")

    def offset(self, time_s: float) -> Vector:
        return np.array([np.interp(time_s, self.times_s, coordinate) for coordinate in self.offsets_m.T])

    def velocity(self, time_s: float) -> Vector:
        """On a waypoint, that of the way to the next one."""
        leg = int(np.searchsorted(self.times_s, time_s, side="right")) - 1
        if not 0 <= leg < len(self.times_s) - 1:
            return np.zeros(self.offsets_m.shape[1])
        step = self.offsets_m[leg + 1] - self.offsets_m[leg]
        return np.asarray(step / (self.times_s[leg + 1] - self.times_s[leg]))

    def travelled(self, start_s: float, end_s: float) -> float:
        legs = np.linalg.norm(np.diff(self.offsets_m, axis=0), axis=1)
        start, end = np.interp([start_s, end_s], self.times_s, np.concatenate([[0.0], legs.cumsum()]))
        return float(end - start)


@dataclass(frozen=True)
class MovingBody:
    """A body and its path; the velocity that the body itself names plays no part.

    Attributes:
        name: Shown where it blocks a path.
        body: Where it is at displacement zero.
        motion: Its displacement.

    Raises:
        ShapeMismatch: If body and motion differ in dimension.
    """

    name: str
    body: Body
    motion: Motion

    def __post_init__(self) -> None:
        found = len(self.motion.offset(0.0))
        if found != self.body.dim:
            raise ShapeMismatch(f"coordinates of the motion of {self.name}", self.body.dim, found)

    @classmethod
    def at_its_velocity(cls, name: str, body: Body) -> "MovingBody":
        """A body that moves on with the velocity that it names; with none it rests."""
        return cls(name, body, ConstantVelocity(body.velocity.numpy().astype(np.float64)))

    @property
    def bounding_radius_m(self) -> float:
        """Radius of a ball around its centre that contains it [m]."""
        return self.body.bounding_radius

    def centre_m(self, time_s: float) -> Vector:
        """Where its reference point is."""
        return np.asarray(self.body.reference.numpy() + self.motion.offset(time_s))

    def signed_distance(self, points_m: Points, time_s: float) -> Float[np.ndarray, " point"]:
        """Distances to the surface at a time [m], negative inside, outside never larger than the true ones.

        Up to 15 cm, or one bounding radius, they are those of the body; farther away the larger of that and the
        distance to the bounding ball, which costs nothing.
        """
        radius = self.bounding_radius_m
        reach = max(radius, EXACT_WITHIN_M)
        offsets = points_m - self.centre_m(time_s)
        found = np.sqrt(np.einsum("pd,pd->p", offsets, offsets)) - radius
        near = np.flatnonzero(found < reach)
        if len(near) > 0:
            exact = self._distance_at_rest(offsets.take(near, axis=0))
            found[near] = np.maximum(found[near], np.minimum(exact, reach))
        return np.asarray(found)

    def swept_distance(
        self, points_m: Points, time_s: float, horizon_s: float, samples: int = 8
    ) -> Float[np.ndarray, " point"]:
        """Smallest distance while the body moves on [m], never larger than the true one outside.

        It is the smallest at equidistant times, less half of the longest way between two of them: at any time, the
        body is no farther than that from where it was looked at.

        Args:
            points_m: At rest meanwhile.
            time_s: When it begins.
            horizon_s: How long it lasts.
            samples: Times looked at, both ends included.

        Raises:
            InvalidSetting: If there are fewer than two samples, or the horizon is negative.
        """
        if samples < 2 or horizon_s < 0:
            raise InvalidSetting("samples, horizon_s", (samples, horizon_s), "2 or more, and a time of 0 or more")
        times_s = np.linspace(time_s, time_s + horizon_s, samples)
        nearest = np.min([self.signed_distance(points_m, float(t)) for t in times_s], axis=0)
        ways = [self.motion.travelled(float(a), float(b)) for a, b in pairwise(times_s)]
        return np.asarray(nearest - max(ways) / 2)

    def _distance_at_rest(self, offsets_m: Points) -> Float[np.ndarray, " point"]:
        reference = self.body.reference
        with torch.no_grad():
            distances = self.body.signed_distance(reference + torch.from_numpy(offsets_m).to(reference))
        return np.asarray(distances.numpy(), dtype=np.float64)
