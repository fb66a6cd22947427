r"""Latent fields that stay in a safety region, by modulation.

.. math:: \hat f = G f + \beta\, G g, \qquad G = E\,\mathrm{diag}(\lambda_n, \lambda_\tau)\,E^{-1}, \quad E = [n\ e]

Proven: λ_n is zero at S = ρ and Lipschitz in S, so along every solution dS/dt ≥ -C (S - ρ), and a motion that starts
where S > ρ never gets there. Not proven: that a contracting field stays contracting, and that every start gets to the
goal.

Source: Thesis Sec. 6.3, Eq. (6.5)-(6.9); Huber, Slotine, Billard (2022).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import nn

from geomotion.dynamics.fields import VectorField
from geomotion.errors import ShapeMismatch
from geomotion.obstacles.safety_region import SafetyRegion, Sight
from geomotion.types import Bool, Float, State, Tensor, Times, Trajectories, Velocity

PLANE = 2
STRIDE = 0.5  # of a cell of the region's grid
MAX_HALVINGS, FEWER_HALVINGS = 8, 3
FREE_STEPS, MEAN_STEPS = 5000, 40  # the latter for each output time, all halves counted; a trained skill takes fewer
PROGRESS = 0.2  # share of the speed of f at which a motion near the border is helped on along its way
HEAD_ON = 0.1  # share of the speed of f that has to point out of the region before a motion is helped fully
CLEAR_PREFERENCE = 0.05  # of the way onward that is tangential: from here on, g has its full length
TINY = 1e-12

Planar = Float[Tensor, "*batch 2"]
Onward = Callable[[Sight], Planar]


def along_geodesic(sight: Sight) -> Planar:
    """Where the remaining geodesic way to the goal shrinks fastest."""
    return sight.onward


def against_geodesic(sight: Sight) -> Planar:
    """The other way, for comparison."""
    return -sight.onward


class SafeField(nn.Module):
    """A field whose first two coordinates are kept in a region; all others do not feel it.

    Args:
        field: f, whose first two coordinates are a system of their own, such as those of a skill.
        region: Where they may be.
        onward: The direction that the tangential field g of Eq. (6.9) is chosen by, from what a point sees; None for
            β = 0.
        recovery_time: How long a start outside of the region takes to come in, in time units of f.
        fastest_return: How fast it does, at most.

    Raises:
        ShapeMismatch: If the field has fewer than two coordinates.
    """

    def __init__(
        self,
        field: VectorField,
        region: SafetyRegion,
        onward: Onward | None = along_geodesic,
        recovery_time: float = 0.02,
        fastest_return: float = math.inf,
    ) -> None:
        super().__init__()
        if field.dim < PLANE:
            raise ShapeMismatch("coordinates of a field with a safety region", "2 or more", field.dim)
        self.field, self.region, self.dim, self.skill_dim = field, region, field.dim, PLANE
        self.onward, self.recovery_time, self.fastest_return = onward, recovery_time, fastest_return

    def forward(self, z: State) -> Velocity:
        wanted = self.field(z)
        kept = self.steered(z[..., :PLANE], wanted[..., :PLANE])
        return torch.cat([kept, wanted[..., PLANE:]], dim=-1)

    def steered(self, points: Planar, wanted: Planar) -> Planar:
        """f̂ from f at latent points.

        What points away from the border is not slowed. Outside of the region, the motion of f ends, and the nearest
        way in takes its place.
        """
        sight = self.region.sight(points)
        velocity = self._modulated(sight, wanted)
        if self.onward is not None:
            velocity = velocity + self._help(sight, wanted, velocity)
        inwards = (sight.depth / self.recovery_time).clamp(max=self.fastest_return) * sight.inward
        return (1 - sight.outside) * velocity + inwards

    @staticmethod
    def _modulated(sight: Sight, velocity: Planar) -> Planar:
        """G times a velocity."""
        along = 2 - sight.freedom
        crossing = (velocity * sight.normal).sum(dim=-1, keepdim=True)
        across = torch.where(crossing < 0, sight.freedom, 1.0)
        return along * velocity + (across - along) * crossing * sight.normal

    def _help(self, sight: Sight, wanted: Planar, modulated: Planar) -> Planar:
        """β G g: as much as it takes to get on at `PROGRESS` of the speed of f, where f points out of the region.

        g is the tangent that is nearer to the way onward. β of the thesis depends on the speed alone and would leave an
        equilibrium beside each one that it removes, where G f and β G g cancel; so what counts here is the speed along
        g. Because g is tangential, G g is λ_τ g, which β takes back.
        """
        assert self.onward is not None
        onward = self.onward(sight)
        tangent = onward - (onward * sight.normal).sum(dim=-1, keepdim=True) * sight.normal
        way = tangent / tangent.norm(dim=-1, keepdim=True).clamp(min=CLEAR_PREFERENCE)
        speed = wanted.norm(dim=-1, keepdim=True).clamp(min=TINY)
        missing = (PROGRESS * speed - (modulated * way).sum(dim=-1, keepdim=True)).clamp(min=0)
        head_on = (-(wanted * sight.normal).sum(dim=-1, keepdim=True) / (HEAD_ON * speed)).clamp(0, 1)
        help_: Tensor = (1 - sight.freedom) * head_on * missing * way
        return help_


@torch.no_grad()
def follow_safely(field: SafeField, starts: Float[Tensor, "start D"], times: Times) -> tuple[Trajectories, int]:
    """Runge-Kutta steps of fourth order from each start, none of which ends outside of the region.

    A solution never leaves the region; a step may, by its error. One that does, or that is longer than `STRIDE` and
    might jump over what is unsafe, is halved, for the trajectories concerned only. Where it cannot be halved any more,
    the motion goes on as far as that is safe, and waits there until the next output time. Fields so wild that this
    happens everywhere would take forever: after the first `FREE_STEPS`, no more than `MEAN_STEPS` for each output time
    are made on average.

    Args:
        field: What to follow.
        starts: Latent states; those outside of the region are free to stay there until they are in it.
        times: Output times, increasing, in time units of the field.

    Returns:
        States, shape (start, time, D), and in how many steps between output times, over all starts, motions waited.
    """
    states, waited, steps = [starts], 0, _Steps(field)
    for number, step in enumerate(times.diff().to(starts), start=1):
        is_within_means = steps.made <= FREE_STEPS + MEAN_STEPS * number
        end, waits = steps.advance(states[-1], step, MAX_HALVINGS if is_within_means else FEWER_HALVINGS)
        states.append(end)
        waited += int(waits.sum())
    return torch.stack(states, dim=1), waited


@dataclass
class _Steps:
    """Steps along a field.

    Attributes:
        field: What to follow.
        made: How many, of all trajectories at once or of some of them.
    """

    field: SafeField
    made: int = 0

    def advance(self, z: State, step: Float[Tensor, ""], halvings: int) -> tuple[State, Bool[Tensor, " start"]]:
        """States one step later, and which of them wait for the rest of it."""
        self.made += 1
        end = _runge_kutta(self.field, z, step)
        refused = _refused(self.field.region, z, end)
        if halvings == 0:
            end[refused] = _as_far_as_safe(self.field.region, z[refused], end[refused])
            return end, refused
        waits = torch.zeros_like(refused)
        if bool(refused.any()):
            middle, waits_early = self.advance(z[refused], step / 2, halvings - 1)
            later, waits_late = self.advance(middle[~waits_early], step / 2, halvings - 1)
            waits[refused] = waits_early.masked_scatter(~waits_early, waits_late)
            end[refused] = middle.index_put((~waits_early,), later)
        return end, waits


def _refused(region: SafetyRegion, z: State, end: State) -> Bool[Tensor, " start"]:
    before, after = z[:, :PLANE], end[:, :PLANE]
    strays = region.is_safe(before) & ~region.is_safe(after)
    return strays | (_cells(region, after - before) > STRIDE)


def _as_far_as_safe(region: SafetyRegion, z: State, end: State) -> State:
    """Along a step up to `STRIDE`; not at all where that is outside, or the step leads nowhere."""
    share = (STRIDE / _cells(region, (end - z)[:, :PLANE])).clamp(max=1)[:, None]
    shortened = z + share * (end - z)
    is_known = shortened.isfinite().all(dim=1)
    strays = region.is_safe(z[:, :PLANE]) & ~region.is_safe(shortened[:, :PLANE])
    return torch.where((is_known & ~strays)[:, None], shortened, z)


def _cells(region: SafetyRegion, moved: Planar) -> Float[Tensor, " start"]:
    return (moved.abs() / region.maps.cell).amax(dim=1)


def _runge_kutta(field: VectorField, z: State, step: Float[Tensor, ""]) -> State:
    k1 = field(z)
    k2 = field(z + step / 2 * k1)
    k3 = field(z + step / 2 * k2)
    k4 = field(z + step * k3)
    return z + step / 6 * (k1 + 2 * (k2 + k3) + k4)
