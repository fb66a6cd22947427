"""Invertible flows of affine couplings whose derivatives are written out.

A coupling keeps some coordinates a and moves the others, b ↦ e^{s(a)} b + t(a). Scale and shift are linear in
random Fourier features of a, so value, inverse and derivative of a layer are a few small products, and one pass
through the conditioners serves ψ(x) and Dψ(x)⁻¹ ż alike.
"""

import math

import torch
from torch import nn

from geomotion.dynamics.fields import PushForward
from geomotion.types import Float, Int, State, Tensor


class CouplingLayer(nn.Module):
    """One affine coupling; the identity at the start.

    Args:
        kept: Coordinates that stay and condition the others.
        moved: Coordinates that are scaled and shifted.
        frequencies: Fixed frequencies of the features, shape (kept, feature).
        phases: Their phases, shape (feature,).
        log_scale_cap: Largest |s|.
    """

    kept: Tensor
    moved: Tensor
    order: Tensor
    frequencies: Tensor
    phases: Tensor

    def __init__(
        self,
        kept: Int[Tensor, " kept"],
        moved: Int[Tensor, " moved"],
        frequencies: Float[Tensor, "kept feature"],
        phases: Float[Tensor, " feature"],
        log_scale_cap: float,
    ) -> None:
        super().__init__()
        self.register_buffer("kept", kept)
        self.register_buffer("moved", moved)
        self.register_buffer("order", torch.argsort(torch.cat([kept, moved])))
        self.register_buffer("frequencies", frequencies)
        self.register_buffer("phases", phases)
        self.log_scale_cap = log_scale_cap
        self.weight = nn.Parameter(torch.zeros(len(phases), 2 * len(moved)))
        self.bias = nn.Parameter(torch.zeros(2 * len(moved)))

    def _join(self, kept: Tensor, moved: Tensor) -> Tensor:
        return torch.cat([kept, moved], -1)[..., self.order]

    def _condition(self, angles: Tensor) -> tuple[Tensor, Tensor]:
        raw, shift = (torch.cos(angles) @ self.weight + self.bias).chunk(2, -1)
        return self.log_scale_cap * torch.tanh(raw / self.log_scale_cap), shift

    def _angles(self, kept: Tensor) -> Tensor:
        return kept @ self.frequencies + self.phases

    def forward(self, x: State) -> State:
        kept = x[..., self.kept]
        log_scale, shift = self._condition(self._angles(kept))
        return self._join(kept, x[..., self.moved] * log_scale.exp() + shift)

    def inverse(self, y: State) -> State:
        """The x with forward(x) = y."""
        kept = y[..., self.kept]
        log_scale, shift = self._condition(self._angles(kept))
        return self._join(kept, (y[..., self.moved] - shift) * (-log_scale).exp())

    def linearise(self, x: State) -> tuple[State, PushForward]:
        """forward(x), and the inverse of its derivative as a function of tangents at forward(x)."""
        kept, moved = x[..., self.kept], x[..., self.moved]
        angles = self._angles(kept)
        log_scale, shift = self._condition(angles)
        scaled = moved * log_scale.exp()

        def push_forward(tangent: Tensor) -> Tensor:
            kept_rate, moved_rate = tangent[..., self.kept], tangent[..., self.moved]
            features_rate = -torch.sin(angles) * (kept_rate @ self.frequencies)
            raw_rate, shift_rate = (features_rate @ self.weight).chunk(2, -1)
            log_scale_rate = raw_rate * (1 - (log_scale / self.log_scale_cap).square())
            return self._join(kept_rate, (moved_rate - scaled * log_scale_rate - shift_rate) * (-log_scale).exp())

        return self._join(kept, scaled + shift), push_forward


class CouplingFlow(nn.Module):
    """ψ: a chain of couplings, each moving what the one before kept; the identity at the start.

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
        halves = torch.randperm(dim) if dim > 2 else torch.arange(dim)
        for number in range(layers):
            if dim > 2 and number % 2 == 0:
                halves = torch.randperm(dim)
            kept, moved = halves[: dim // 2].sort().values, halves[dim // 2 :].sort().values
            if number % 2:
                kept, moved = moved, kept
            frequencies = torch.randn(len(kept), features) / length_scale
            phases = 2 * math.pi * torch.rand(features)
            self.layers.append(CouplingLayer(kept, moved, frequencies, phases, log_scale_cap))

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
