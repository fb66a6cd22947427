"""Charts without learned parameters, and their composition."""

import torch
from torch import nn

from geomotion.dynamics.fields import Chart, PushForward
from geomotion.types import Float, State, Tensor


class IdentityChart(nn.Module):
    """The state itself."""

    def __init__(self, dim: int) -> None:
        super().__init__()
        self.dim = dim

    def to_latent(self, x: State) -> State:
        return x

    def to_ambient(self, z: State) -> State:
        return z

    def linearise(self, x: State) -> tuple[State, PushForward]:
        return x, lambda velocity: velocity


class ScalingChart(nn.Module):
    """z = (x - centre) / scale with one scale for all axes, so that angles and the metric's shape are kept.

    Args:
        centre: Point that becomes the origin [m].
        scale: Length that becomes one [m].
    """

    centre: Tensor
    scale: Tensor

    def __init__(self, centre: Float[Tensor, " D"], scale: float) -> None:
        super().__init__()
        self.dim = centre.shape[0]
        self.register_buffer("centre", centre)
        self.register_buffer("scale", torch.as_tensor(scale, dtype=centre.dtype))

    def to_latent(self, x: State) -> State:
        return (x - self.centre) / self.scale

    def to_ambient(self, z: State) -> State:
        return z * self.scale + self.centre

    def linearise(self, x: State) -> tuple[State, PushForward]:
        return self.to_latent(x), lambda velocity: velocity * self.scale


class ComposedChart(nn.Module):
    """First `inner`, then `outer`: z = outer(inner(x))."""

    def __init__(self, inner: Chart, outer: Chart) -> None:
        super().__init__()
        self.inner = inner
        self.outer = outer
        self.dim = inner.dim

    def to_latent(self, x: State) -> State:
        return self.outer.to_latent(self.inner.to_latent(x))

    def to_ambient(self, z: State) -> State:
        return self.inner.to_ambient(self.outer.to_ambient(z))

    def linearise(self, x: State) -> tuple[State, PushForward]:
        middle, push_inner = self.inner.linearise(x)
        z, push_outer = self.outer.linearise(middle)
        return z, lambda velocity: push_inner(push_outer(velocity))
