r"""Latent fields that stay in a safety region, by modulation.

.. math:: \hat f = G f + \beta\, G g, \qquad G = E\,\mathrm{diag}(\lambda_n, \lambda_\tau)\,E^{-1}, \quad E = [n\ e]

Proven: λ_n is zero at S = ρ and Lipschitz in S, so along every solution dS/dt ≥ -C (S - ρ), and a motion that starts
where S > ρ never gets there. Not proven: that a contracting field stays contracting, and that every start gets to the
goal.

Source: Thesis Sec. 6.3, Eq. (6.5)-(6.9); Huber, Slotine, Billard (2022).
"""

from collections.abc import Callable

import torch
from torch import nn

from geomotion.dynamics.fields import VectorField
from geomotion.errors import ShapeMismatch
from geomotion.obstacles.safety_region import SafetyRegion, Sight
from geomotion.types import Float, State, Tensor, Times, Trajectories, Velocity

PLANE = 2
STRIDE = 0.5  # of a cell of the region's grid
MAX_HALVINGS = 8
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
        recovery_time: How long a start outside of the region takes to come in, per time unit of f.

    Raises:
        ShapeMismatch: If the field has fewer than two coordinates.
    """

    def __init__(
        self,
        field: VectorField,
        region: SafetyRegion,
        onward: Onward | None = along_geodesic,
        recovery_time: float = 0.02,
    ) -> None:
        super().__init__()
        if field.dim < PLANE:
            raise ShapeMismatch("coordinates of a field with a safety region", "2 or more", field.dim)
        self.field, self.region, self.dim, self.skill_dim = field, region, field.dim, PLANE
        self.onward, self.recovery_time = onward, recovery_time

    def forward(self, z: State) -> Velocity:
        wanted = self.field(z)
        kept = self.steered(self.region.sight(z[..., :PLANE]), wanted[..., :PLANE])
        return torch.cat([kept, wanted[..., PLANE:]], dim=-1)

    def steered(self, sight: Sight, wanted: Planar) -> Planar:
        """f̂ from f, where points are as seen from the border.

        What points away from the border is not slowed. Outside of the region, the motion of f fades, and the nearest
        way in takes its place.
        """
        velocity = self._modulated(sight, wanted)
        if self.onward is not None:
            velocity = velocity + self._help(sight, wanted, velocity)
        inwards = sight.depth / self.recovery_time * sight.normal
        faded = (sight.distance / self.region.levels.guarded).clamp(max=1)
        return faded * velocity + inwards

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
    the motion waits for that long.

    Args:
        field: What to follow.
        starts: Latent states; those outside of the region are free to stay there until they are in it.
        times: Output times, increasing, in time units of the field.

    Returns:
        States, shape (start, time, D), and how many steps were waited.
    """
    states, waited = [starts], 0
    for step in times.diff().to(starts):
        end, more = _advance(field, states[-1], step, MAX_HALVINGS)
        states.append(end)
        waited += more
    return torch.stack(states, dim=1), waited


def _advance(field: SafeField, z: State, step: Float[Tensor, ""], halvings: int) -> tuple[State, int]:
    end = _runge_kutta(field, z, step)
    region, before, after = field.region, z[:, :PLANE], end[:, :PLANE]
    strays = region.is_safe(before) & ~region.is_safe(after)
    strides = ((after - before).abs() > STRIDE * region.maps.cell).any(dim=1)
    refused = strays | strides if halvings > 0 else strays
    if not bool(refused.any()):
        return end, 0
    if halvings == 0:
        end[strays] = z[strays]
        return end, int(strays.sum())
    middle, waited = _advance(field, z[refused], step / 2, halvings - 1)
    end[refused], more = _advance(field, middle, step / 2, halvings - 1)
    return end, waited + more


def _runge_kutta(field: VectorField, z: State, step: Float[Tensor, ""]) -> State:
    k1 = field(z)
    k2 = field(z + step / 2 * k1)
    k3 = field(z + step / 2 * k2)
    k4 = field(z + step * k3)
    return z + step / 6 * (k1 + 2 * (k2 + k3) + k4)
