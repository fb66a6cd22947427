"""What a motion keeps of where it began: an offset that fades out, apart from what pushes the robot later."""

import torch
from torch import nn

from geomotion.types import Float, State, Tensor, Trajectories, Velocity

REACH = 1.5  # times the farthest shown start


class CarriedOffset(nn.Module):
    r"""By how much motions are beside those from the mean start, at times since they began.

    .. math:: s(t)\,\delta, \qquad s = 1 - 3u^2 + 2u^3, \quad u = \min(t / T, 1)

    Smooth, with a velocity that vanishes at both ends, so that motions still begin at rest.

    Args:
        offset: δ of each motion.
        fade_s: T [s].
        begin_s: How long the motions have run already [s].
    """

    offset: Tensor
    fade_s: Tensor

    def __init__(self, offset: State, fade_s: Float[Tensor, ""], begin_s: float = 0.0) -> None:
        super().__init__()
        self.register_buffer("offset", offset)
        self.register_buffer("fade_s", fade_s)
        self.begin_s = begin_s

    def at(self, elapsed_s: Float[Tensor, "*#batch 1"]) -> State:
        """The offset of each motion at a time of its own."""
        return faded(self._share(elapsed_s)) * self.offset

    def velocity(self, elapsed_s: Float[Tensor, "*#batch 1"]) -> Velocity:
        """What it changes by [1/s]."""
        return fading(self._share(elapsed_s)) / self.fade_s * self.offset

    def along(self, elapsed_s: Float[Tensor, " time"]) -> Trajectories:
        """Offsets of all motions at the same times, shape (*batch, time, D)."""
        return faded(self._share(elapsed_s))[..., None] * self.offset[..., None, :]

    def later(self, begin_s: float) -> "CarriedOffset":
        """The same for motions that have run on for some time [s]."""
        return CarriedOffset(self.offset, self.fade_s, self.begin_s + begin_s)

    def _share(self, elapsed_s: Tensor) -> Tensor:
        return (elapsed_s + self.begin_s) / self.fade_s


class StartMemory(nn.Module):
    r"""The starts that demonstrations had, beside which others are remembered.

    .. math:: x(t) = y(t) + s(t)\,\delta, \qquad \delta = x(0) - \bar x_0

    y is the motion of a field that need not know other starts than the mean one, x̄_0. Of a start that is farther away
    than `REACH` times the shown ones only that much is remembered; the rest is up to the field, like a push.

    Args:
        dim: Coordinates of a state.
        fade_s: T, after which nothing is left of δ [s].
    """

    mean_start: Tensor
    reach: Tensor
    fade_s: Tensor

    def __init__(self, dim: int, fade_s: float) -> None:
        super().__init__()
        self.register_buffer("mean_start", torch.zeros(dim))
        self.register_buffer("reach", torch.zeros(()))
        self.register_buffer("fade_s", torch.tensor(fade_s))

    def learn(self, starts: Float[Tensor, "demo D"]) -> None:
        """Take x̄_0, and how far starts are from it, from demonstrations."""
        self.mean_start.copy_(starts.mean(0))
        self.reach.copy_(REACH * (starts - self.mean_start).norm(dim=-1).max())

    def offset(self, start: State) -> State:
        """δ of motions from these starts."""
        beside = start - self.mean_start
        distance = beside.norm(dim=-1, keepdim=True).clamp(min=torch.finfo(start.dtype).tiny)
        remembered: State = beside * (self.reach / distance).clamp(max=1)
        return remembered

    def carried(self, start: State) -> CarriedOffset:
        """What motions from these starts carry along."""
        return CarriedOffset(self.offset(start), self.fade_s)


def faded(share: Tensor) -> Tensor:
    """s, what is left of an offset after a share of the time that it takes to fade."""
    u = share.clamp(0, 1)
    return 1 - u * u * (3 - 2 * u)


def fading(share: Tensor) -> Tensor:
    """The derivative of :func:`faded`."""
    u = share.clamp(0, 1)
    return 6 * u * (u - 1)
