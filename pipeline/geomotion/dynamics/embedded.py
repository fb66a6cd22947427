"""A skill of few dimensions in a space of many: a field on the first coordinates, while all others decay."""

import torch
from torch import nn

from geomotion.dynamics.fields import SolvableField, has_closed_form
from geomotion.dynamics.linear import LinearField
from geomotion.dynamics.potential import PotentialField
from geomotion.types import Float, State, Tensor, Trajectories, Velocity


class EmbeddedField(nn.Module):
    r"""A contracting field of d coordinates z_m, and a pull back to where the remaining ones z_e vanish.

    .. math:: \dot z_m = f(z_m), \qquad \dot z_e = -k z_e

    The symmetric part of its Jacobian is block-diagonal, so it contracts at the lesser of the rate of f and k: behind
    one chart of the whole space, this certifies a skill in all dimensions, wherever the robot is pushed to.

    Args:
        field: f, linear or a potential field.
        dim: D, coordinates in all, more than those of f.
        transverse_rate: k, per time unit. It may be changed at any time; what is certified changes with it.
    """

    transverse_rate: Tensor

    def __init__(self, field: LinearField | PotentialField, dim: int, transverse_rate: float) -> None:
        super().__init__()
        self.field = field
        self.skill_dim = field.dim
        self.dim = dim
        self.register_buffer("transverse_rate", torch.tensor(transverse_rate))

    @property
    def rate(self) -> float:
        """Contraction rate, per time unit."""
        return min(self.field.rate, float(self.transverse_rate))

    @property
    def is_solvable(self) -> bool:
        """Whether f has trajectories in closed form."""
        return has_closed_form(self.field)

    def project(self, z: State) -> State:
        """The same skill coordinates on the manifold where all others vanish."""
        return torch.cat([z[..., : self.skill_dim], torch.zeros_like(z[..., self.skill_dim :])], dim=-1)

    def forward(self, z: State) -> Velocity:
        along, across = z[..., : self.skill_dim], z[..., self.skill_dim :]
        return torch.cat([self.field(along), -self.transverse_rate * across], dim=-1)

    def solve(
        self,
        start: State,
        times: Float[Tensor, "*#batch time"],
        transverse_times: Float[Tensor, "*#batch time"] | None = None,
    ) -> Trajectories:
        """Trajectories, shape (*batch, time, D); only where f has them in closed form.

        Args:
            start: z at time 0.
            times: When they are wanted.
            transverse_times: What the clock of z_e shows then; None: the same.
        """
        assert isinstance(self.field, SolvableField)
        along = self.field.solve(start[..., : self.skill_dim], times)
        passed = times if transverse_times is None else transverse_times
        across = start[..., None, self.skill_dim :] * (-self.transverse_rate * passed[..., None]).exp()
        return torch.cat([along, across], dim=-1)


class RisingClock:
    """The clock of the remaining coordinates: slow at the start of a motion, then like any other.

    Where a person begins is part of what is shown, and leads over to the skill as slowly as people let it; what pushes
    the robot later is a disturbance, and is undone at the full rate.

    Args:
        at_start: Its speed at the start, above 0, at most 1.
        until: When its speed, which rises with the square of time, is 1, in time units.
    """

    def __init__(self, at_start: float, until: float) -> None:
        self.at_start = at_start
        self.until = until

    def slowest(self) -> float:
        """Its speed at the start."""
        return self.at_start

    def speed(self, times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """Its speed at times after the start."""
        return self.at_start + (1 - self.at_start) * (times / self.until).clamp(0, 1).square()

    def progress(self, times: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """What it shows at times after the start."""
        rising = times.clamp(max=self.until)
        early = self.at_start * rising + (1 - self.at_start) * rising.pow(3) / (3 * self.until**2)
        return early + (times - self.until).clamp(min=0)
