"""Dormand-Prince steps of each trajectory's own size, none of which ends inside an obstacle.

A solution never enters an obstacle; a step may, by its error. A step whose estimated error is too large, or that leads
inside deeper than rounding explains, is halved, for the trajectories concerned only. What is left, `TOUCH` of the
obstacle's smallest radius, is less than the error that the solver is allowed anyway; there the state is put on the
surface, along the reference direction. Wanted times within a step come from its interpolant and are checked alike.

Source: Hairer, Nørsett, Wanner (1993), Solving Ordinary Differential Equations I, Sec. II.5 and II.6.
"""

import math
from dataclasses import dataclass

import torch

from geomotion.obstacles.modulation import ModulatedField
from geomotion.obstacles.obstacle import Obstacle, surface_points
from geomotion.obstacles.solids import unit
from geomotion.types import Bool, Float, State, Tensor, Times, Trajectories

STEPS = 30  # that a rollout begins with, before any is halved
TOUCH = 1e-6  # of the smallest radius
ROUNDING = 8  # of the last digit of a coordinate
MAX_HALVINGS = 14
FOR_ACCURACY = 8  # halvings at most, where a step does not enter an obstacle: a field may have kinks

NODES = (0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0)
TABLEAU = (
    (),
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
ERROR = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)
BETWEEN = (
    -12715105075 / 11282082432, 0.0, 87487479700 / 32700410799, -10690763975 / 1880347072,
    701980252875 / 199316789632, -1453857185 / 822651844, 69997945 / 29380423,
)  # fmt: skip


@dataclass(frozen=True)
class Stretch:
    """A stretch of time and the wanted times in it, the last of which is its end [s]."""

    begin_s: float
    wanted_s: tuple[float, ...]

    @property
    def end_s(self) -> float:
        """Its last wanted time."""
        return self.wanted_s[-1]

    def halves(self) -> tuple["Stretch", "Stretch"]:
        """Both halves; the end of the first, its middle, is wanted of it beside what was."""
        middle = (self.begin_s + self.end_s) / 2
        early = tuple(time for time in self.wanted_s if time < middle)
        return Stretch(self.begin_s, (*early, middle)), Stretch(middle, self.wanted_s[len(early) :])


@dataclass
class GuardedSolver:
    """Follows a modulated field from each start.

    Attributes:
        field: The field.
        relative_tolerance: Of each step, of the largest coordinate.
        absolute_tolerance: Of each step [m].
        unfinished: How many steps were still refused when they could not be halved any more.
    """

    field: ModulatedField
    relative_tolerance: float
    absolute_tolerance: float
    unfinished: int = 0

    @torch.no_grad()
    def solve(self, starts: Float[Tensor, "start D"], times: Times) -> Trajectories:
        """States at times [s] after the obstacles were where their reference points say.

        States that start inside an obstacle are free to stay there until they have left it.
        """
        wanted = times.tolist()
        stride = math.ceil((len(wanted) - 1) / STEPS)
        parts = [starts[:, None]]
        for first in range(0, len(wanted) - 1, stride):
            stretch = Stretch(wanted[first], tuple(wanted[first + 1 : first + stride + 1]))
            parts.append(self._advance(parts[-1][:, -1], stretch, MAX_HALVINGS))
        return torch.cat(parts, dim=1)

    def _advance(self, x: State, stretch: Stretch, halvings: int) -> Float[Tensor, "start time D"]:
        found, error = self._step(x, stretch)
        largest = torch.maximum(x.abs(), found[:, -1].abs()).amax(dim=-1)
        is_accurate = error <= self.absolute_tolerance + self.relative_tolerance * largest  # never of NaN
        is_known = x.isfinite().all(dim=-1)
        enters = self._enters(x, found, stretch) & is_known
        is_refused = enters if halvings <= MAX_HALVINGS - FOR_ACCURACY else enters | ~is_accurate & is_known
        self.unfinished += int((~is_accurate & is_known & ~is_refused).sum())
        if bool(is_refused.any()) and halvings > 0:
            first, second = stretch.halves()
            early = self._advance(x[is_refused], first, halvings - 1)
            late = self._advance(early[:, -1], second, halvings - 1)
            found[is_refused] = torch.cat([early[:, :-1], late], dim=1)
        return self._kept_outside(x, found, stretch)

    def _step(self, x: State, stretch: Stretch) -> tuple[Float[Tensor, "start time D"], Float[Tensor, " start"]]:
        """States at the wanted times, and the estimated error of the last."""
        step = stretch.end_s - stretch.begin_s
        slopes: list[Tensor] = []
        end = x
        for node, row in zip(NODES, TABLEAU, strict=True):
            end = x + step * _combine(row, slopes, x)
            slopes.append(self.field.velocity(end, torch.full_like(x[:, :1], stretch.begin_s + node * step)))
        share = (x.new_tensor(stretch.wanted_s[:-1]) - stretch.begin_s)[:, None] / step
        change, first = (end - x)[:, None], (step * slopes[0] - (end - x))[:, None]
        last = change - step * slopes[-1][:, None] - first
        bend = step * _combine(BETWEEN, slopes, x)[:, None]
        between = x[:, None] + share * (change + (1 - share) * (first + share * (last + (1 - share) * bend)))
        error = step * _combine(ERROR, slopes, x)
        return torch.cat([between, end[:, None]], dim=1), error.abs().amax(dim=-1)

    def _enters(self, x: State, found: Float[Tensor, "start time D"], stretch: Stretch) -> Bool[Tensor, " start"]:
        enters = torch.zeros_like(x[:, 0], dtype=torch.bool)
        x, found = self.field.position(x), self.field.position(found)
        for obstacle in self.field.obstacles:
            was_outside = _depth(obstacle, x, stretch.begin_s) <= _touch(obstacle, x)
            times = found.new_tensor(stretch.wanted_s)[:, None]
            enters |= was_outside & (_depth(obstacle, found, times) > _touch(obstacle, found)).any(dim=-1)
        return enters

    def _kept_outside(
        self, x: State, found: Float[Tensor, "start time D"], stretch: Stretch
    ) -> Float[Tensor, "start time D"]:
        times = found.new_tensor(stretch.wanted_s)[:, None]
        before, after = self.field.position(x), self.field.position(found)  # parts of states, not copies
        for obstacle in self.field.obstacles:
            was_outside = _depth(obstacle, before, stretch.begin_s) <= _touch(obstacle, before)
            inside = was_outside[:, None] & (_depth(obstacle, after, times) > 0)
            if bool(inside.any()):
                moved = (obstacle.velocity * times).expand_as(after)[inside]
                direction = unit(after[inside] - moved - obstacle.reference)
                after[inside] = surface_points(obstacle, direction) + moved
        return found


def _combine(weights: tuple[float, ...], slopes: list[Tensor], like: Tensor) -> Tensor:
    total = torch.zeros_like(like)
    for weight, slope in zip(weights, slopes, strict=True):
        total = total + weight * slope if weight else total
    return total


def _depth(
    obstacle: Obstacle, x: Float[Tensor, "*batch D"], time_s: float | Float[Tensor, "time 1"]
) -> Float[Tensor, "*batch"]:
    """Inside an obstacle, in units of its smallest radius; negative outside."""
    return 1 - obstacle.level(x - obstacle.velocity * time_s).sqrt()


def _touch(obstacle: Obstacle, x: Float[Tensor, "*batch D"]) -> Float[Tensor, "*batch"]:
    """What counts as the surface."""
    return TOUCH + ROUNDING * torch.finfo(x.dtype).eps * x.abs().amax(dim=-1) / obstacle.inradius
