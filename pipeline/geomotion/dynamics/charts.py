"""Charts without learned parameters, and their composition."""

from collections.abc import Callable

import torch
from torch import nn

from geomotion.dynamics.fields import Chart, PushForward
from geomotion.types import Float, Latent, State, Tensor


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


class TurnedChart(nn.Module):
    """z = Vᵀ x for an orthogonal V: the same lengths along other axes.

    Args:
        axes: V, its columns the new axes, shape (D, D).
    """

    axes: Tensor

    def __init__(self, axes: Float[Tensor, "D D"]) -> None:
        super().__init__()
        self.dim = len(axes)
        self.register_buffer("axes", axes)

    def to_latent(self, x: State) -> State:
        return x @ self.axes

    def to_ambient(self, z: State) -> State:
        return z @ self.axes.T

    def linearise(self, x: State) -> tuple[State, PushForward]:
        return self.to_latent(x), self.to_ambient


class ComposedChart(nn.Module):
    """First `inner`, then `outer`: z = outer(inner(x))."""

    def __init__(self, inner: Chart, outer: Chart) -> None:
        super().__init__()
        self.inner = inner
        self.outer = outer
        self.dim = inner.dim

    def to_latent(self, x: State) -> Latent:
        return self.outer.to_latent(self.inner.to_latent(x))

    def to_ambient(self, z: Latent) -> State:
        return self.inner.to_ambient(self.outer.to_ambient(z))

    def linearise(self, x: State) -> tuple[Latent, PushForward]:
        middle, push_inner = self.inner.linearise(x)
        z, push_outer = self.outer.linearise(middle)
        return z, lambda velocity: push_inner(push_outer(velocity))


class AnchoredChart(nn.Module):
    """z = ψ(x) - ψ(x*): the same chart with the anchor x* at the origin.

    While training, ψ(x*) follows the parameters; in evaluation mode it is computed once.

    Args:
        chart: ψ.
        anchor: x*, shape (D,) [m].
    """

    anchor: Tensor

    def __init__(self, chart: Chart, anchor: Float[Tensor, " D"]) -> None:
        super().__init__()
        self.chart = chart
        self.dim = chart.dim
        self.register_buffer("anchor", anchor)
        self._image: Tensor | None = None

    def train(self, mode: bool = True) -> "AnchoredChart":
        self._image = None
        return super().train(mode)

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> "AnchoredChart":
        self._image = None  # moved to another type or device
        super()._apply(fn, recurse)  # type: ignore[no-untyped-call]
        return self

    @property
    def image(self) -> Float[Tensor, " D"]:
        """ψ(x*)."""
        if self.training:
            return self.chart.to_latent(self.anchor)
        if self._image is None:
            self._image = self.chart.to_latent(self.anchor).detach()
        return self._image

    def to_latent(self, x: State) -> State:
        return self.chart.to_latent(x) - self.image

    def to_ambient(self, z: State) -> State:
        return self.chart.to_ambient(z + self.image)

    def linearise(self, x: State) -> tuple[State, PushForward]:
        z, push_forward = self.chart.linearise(x)
        return z - self.image, push_forward
