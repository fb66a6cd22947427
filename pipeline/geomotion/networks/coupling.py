"""Invertible flows of affine couplings whose derivatives are written out.

A coupling keeps some coordinates and moves the others, b ↦ e^{s(a)} b + t(a). Scale and shift are linear in fixed
random Fourier features of the kept coordinates a, so value, inverse and derivative of a layer are a few small
products, and one pass through the conditioners serves ψ(x) and Dψ(x)⁻¹ ż alike.

Which coordinates are kept is a matter of zeros in the layer's matrices: nothing is gathered or concatenated, which
would cost more than the arithmetic where a control loop asks for one state at a time.
"""

import math

import torch
from torch import nn

from geomotion.dynamics.fields import PushForward
from geomotion.types import Bool, Float, State, Tensor


class CouplingLayer(nn.Module):
    """One affine coupling; the identity at the start.

    Args:
        moved: Which coordinates are scaled and shifted; the others condition them.
        frequencies: Fixed frequencies of the features; rows of moved coordinates do not count.
        phases: Their phases.
        log_scale_cap: Largest |s|.
    """

    frequencies: Tensor
    phases: Tensor
    mask: Tensor

    def __init__(
        self,
        moved: Bool[Tensor, " D"],
        frequencies: Float[Tensor, "D feature"],
        phases: Float[Tensor, " feature"],
        log_scale_cap: float,
    ) -> None:
        super().__init__()
        self.register_buffer("frequencies", frequencies * ~moved[:, None])
        self.register_buffer("phases", phases)
        self.register_buffer("mask", torch.cat([moved, moved]).to(frequencies))
        self.log_scale_cap = log_scale_cap
        self.gain = math.sqrt(2 / len(phases))
        self.weight = nn.Parameter(torch.zeros(len(phases), 2 * len(moved)))
        self.bias = nn.Parameter(torch.zeros(2 * len(moved)))

    def _angles(self, x: State) -> Tensor:
        return x @ self.frequencies + self.phases

    def _weight(self) -> Tensor:
        return self.weight * (self.gain * self.mask)

    def _condition(self, angles: Tensor, weight: Tensor) -> tuple[Tensor, Tensor]:
        """tanh of the raw log scale, and the shift; zero for kept coordinates."""
        raw, shift = (torch.cos(angles) @ weight + self.bias * self.mask).chunk(2, -1)
        return torch.tanh(raw), shift

    def forward(self, x: State) -> State:
        squashed, shift = self._condition(self._angles(x), self._weight())
        return x * (self.log_scale_cap * squashed).exp() + shift

    def inverse(self, y: State) -> State:
        """The x with forward(x) = y."""
        squashed, shift = self._condition(self._angles(y), self._weight())
        return (y - shift) * (-self.log_scale_cap * squashed).exp()

    def linearise(self, x: State) -> tuple[State, PushForward]:
        """forward(x), and the inverse of its derivative as a function of tangents at forward(x)."""
        angles, weight = self._angles(x), self._weight()
        squashed, shift = self._condition(angles, weight)
        scale = (self.log_scale_cap * squashed).exp()
        scaled = x * scale

        def push_forward(tangent: Tensor) -> Tensor:
            # kept coordinates of a tangent pass unchanged, so its angles can be taken before the layer is undone
            features_rate = torch.sin(angles) * (tangent @ self.frequencies)
            raw_rate, shift_rate = (features_rate @ weight).chunk(2, -1)  # up to sign: cos' = -sin
            log_scale_rate = raw_rate * (1 - squashed * squashed) * self.log_scale_cap
            return (tangent + scaled * log_scale_rate + shift_rate) / scale

        return scaled + shift, push_forward


class CouplingFlow(nn.Module):
    """ψ: a chain of couplings; the identity at the start.

    In two dimensions the coordinates take turns; in more, random halves do, each pair of layers moving all of them.

    Args:
        dim: D, at least 2.
        layers: Couplings.
        features: Random Fourier features of each.
        length_scale: Over which the features vary, in the input's units.
        log_scale_cap: Largest |log scale| of one coupling.
    """

    def __init__(self, dim: int, layers: int, features: int, length_scale: float, log_scale_cap: float) -> None:
        super().__init__()
        self.dim = dim
        self.layers = nn.ModuleList()
        order = torch.arange(dim)
        for number in range(layers):
            if dim > 2 and number % 2 == 0:
                order = torch.randperm(dim)
            moved = torch.zeros(dim, dtype=torch.bool)
            moved[order[dim // 2 :] if number % 2 == 0 else order[: dim // 2]] = True
            frequencies = torch.randn(dim, features) / length_scale
            self.layers.append(CouplingLayer(moved, frequencies, 2 * math.pi * torch.rand(features), log_scale_cap))

    def to_latent(self, x: State) -> State:
        """ψ(x)."""
        for layer in self.layers:
            x = layer(x)
        return x

    def to_ambient(self, z: State) -> State:
        """ψ⁻¹(z)."""
        for layer in reversed(self.layers):
            z = layer.inverse(z)
        return z

    def linearise(self, x: State) -> tuple[State, PushForward]:
        """ψ(x) and ż ↦ Dψ(x)⁻¹ ż."""
        pushes: list[PushForward] = []
        for layer in self.layers:
            x, push = layer.linearise(x)
            pushes.append(push)

        def push_forward(tangent: Tensor) -> Tensor:
            for push in reversed(pushes):
                tangent = push(tangent)
            return tangent

        return x, push_forward
