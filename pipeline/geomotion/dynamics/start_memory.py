"""What a motion carries along beside a field: how far from the others it began, and where all of them lead."""

import torch
from torch import nn

from geomotion.dynamics.fading_spline import FadingSpline
from geomotion.types import Float, State, Tensor, Trajectories, Velocity

REACH = 1.5  # times the farthest shown start
INTERVALS = 96  # of what is carried along whatever the start is


class CarriedOffset(nn.Module):
    r"""By how much motions are beside those of the field from the mean start, at times since they began.

    .. math:: c(t) = s(t)\,\delta + r(t), \qquad s = 1 - 3u^2 + 2u^3, \quad u = \min(t / T, 1)

    s has a velocity that vanishes at both ends; r ends at rest at zero.

    Args:
        offset: δ of each motion.
        memory: T, and r.
        begin_s: How long the motions have run already [s].
    """

    offset: Tensor

    def __init__(self, offset: State, memory: "StartMemory", begin_s: float = 0.0) -> None:
        super().__init__()
        self.register_buffer("offset", offset)
        self.memory = memory
        self.begin_s = begin_s

    def at(self, elapsed_s: Float[Tensor, "*#batch 1"]) -> State:
        """The offset of each motion at a time of its own."""
        fade, shared = self._shares(elapsed_s)
        return faded(fade) * self.offset + self.memory.remainder.at(shared[..., 0])

    def velocity(self, elapsed_s: Float[Tensor, "*#batch 1"]) -> Velocity:
        """What it changes by [1/s]."""
        fade, shared = self._shares(elapsed_s)
        fading_away = fading(fade) / self.memory.fade_s * self.offset
        return fading_away + self.memory.remainder.rate(shared[..., 0]) / self.memory.span_s

    def along(self, elapsed_s: Float[Tensor, " time"]) -> Trajectories:
        """Offsets of all motions at the same times, shape (*batch, time, D)."""
        fade, shared = self._shares(elapsed_s)
        return faded(fade)[..., None] * self.offset[..., None, :] + self.memory.remainder.at(shared)

    def later(self, begin_s: float) -> "CarriedOffset":
        """The same for motions that have run on for some time [s]."""
        return CarriedOffset(self.offset, self.memory, self.begin_s + begin_s)

    def _shares(self, elapsed_s: Tensor) -> tuple[Tensor, Tensor]:
        """Of the time in which δ fades, and of that in which r does."""
        time_s = elapsed_s + self.begin_s
        return time_s / self.memory.fade_s, time_s / self.memory.span_s


class StartMemory(nn.Module):
    r"""The starts that demonstrations had, beside which others are remembered.

    .. math:: x(t) = y(t) + s(t)\,\delta + r(t), \qquad \delta = x(0) - \bar x_0

    y is the motion of a field that need not know other starts than the mean one, x̄_0. Of a start that is farther away
    than `REACH` times the shown ones only that much is remembered; the rest is up to the field, like a push. r is what
    the motion from the mean start lacks of the path that was asked for; zero where none was.

    Args:
        dim: Coordinates of a state.
        fade_s: T, after which nothing is left of δ [s].
    """

    mean_start: Tensor
    reach: Tensor
    fade_s: Tensor
    span_s: Tensor

    def __init__(self, dim: int, fade_s: float) -> None:
        super().__init__()
        self.register_buffer("mean_start", torch.zeros(dim))
        self.register_buffer("reach", torch.zeros(()))
        self.register_buffer("fade_s", torch.tensor(fade_s))
        self.register_buffer("span_s", torch.tensor(fade_s))
        self.remainder = FadingSpline(dim, INTERVALS)

    def learn(self, starts: Float[Tensor, "demo D"]) -> None:
        """Take x̄_0, and how far starts are from it, from demonstrations."""
        self.mean_start.copy_(starts.mean(0))
        self.reach.copy_(REACH * (starts - self.mean_start).norm(dim=-1).max())

    def carry(self, remainder: Float[Tensor, "point D"], span_s: float) -> None:
        """Take r from values at equal times over a span, of which the last counts as zero."""
        self.span_s.fill_(span_s)
        self.remainder.fit(remainder)

    def offset(self, start: State) -> State:
        """δ of motions from these starts."""
        beside = start - self.mean_start
        distance = beside.norm(dim=-1, keepdim=True).clamp(min=torch.finfo(start.dtype).tiny)
        remembered: State = beside * (self.reach / distance).clamp(max=1)
        return remembered

    def carried(self, start: State) -> CarriedOffset:
        """What motions from these starts carry along."""
        return CarriedOffset(self.offset(start), self)


def faded(share: Tensor) -> Tensor:
    """s, what is left of an offset after a share of the time that it takes to fade."""
    u = share.clamp(0, 1)
    return 1 - u * u * (3 - 2 * u)


def fading(share: Tensor) -> Tensor:
    """The derivative of :func:`faded`."""
    u = share.clamp(0, 1)
    return 6 * u * (u - 1)
