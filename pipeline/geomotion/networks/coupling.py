"""Invertible flows of affine couplings whose derivatives are written out.

A coupling keeps some coordinates a and moves the others, b ↦ e^{s(a)} b + t(a). Scale and shift are linear in fixed
Fourier features of the kept coordinates, so value, inverse and derivative of a layer are a few small products, and one
pass through the conditioners serves ψ(x) and Dψ(x)⁻¹ ż alike.

Which coordinates are kept is a matter of zeros in the layers' matrices: all layers have the same shapes in any
dimension, and nothing is gathered or concatenated, which would cost more than the arithmetic where a control loop asks
for one state at a time.

With a context c, the linear maps are linear in it, too, W(c) = Σ cₖ Wₖ: each c has a flow of its own, as large as one
without context, and nearby contexts have similar ones. Letting the Fourier features depend on c instead would make all
contexts share the parameters of one flow.
"""

import math
from collections.abc import Sequence

import torch
from torch import nn

from geomotion.dynamics.fields import PushForward
from geomotion.types import Bool, Float, State, Tensor

TAIL = 1e-4  # quasi-random numbers are kept this far from 0 and 1, where the normal quantile is infinite


class CouplingFlow(nn.Module):
    """ψ: a chain of couplings; the identity at the start.

    In two dimensions the coordinates take turns; in more, random halves do, each pair of layers moving all of them.

    With context, states are (x, c) and ψ(x, c) = (ψ_c(x), c) with ψ_c(0) = 0 for every c and all parameters. Tangents
    that are pushed forward leave c as it is.

    Args:
        dim: Coordinates that are moved, at least 2.
        layers: Couplings.
        features: Fourier features of each; cosine and sine of one angle count as two.
        length_scales: Over which the features vary, in the input's units; the features are spread evenly over them.
        log_scale_cap: Largest |s| of one coupling.
        context: K, coordinates behind those that are moved.
    """

    frequencies: Tensor
    phases: Tensor
    moved: Tensor

    def __init__(
        self,
        dim: int,
        layers: int,
        features: int,
        length_scales: Sequence[float],
        log_scale_cap: float,
        context: int = 0,
    ) -> None:
        super().__init__()
        self.dim = dim + context
        self.context = context
        self._terms = max(1, context)  # matrices of which each layer's are made
        self.log_scale_cap = log_scale_cap
        kept = alternating_halves(dim, layers)
        pairs = features // 2
        frequencies = torch.zeros(layers, dim, pairs)
        for layer in range(layers):
            frequencies[layer, kept[layer]] = normal_frequencies(pairs, int(kept[layer].sum()), length_scales)
        self.register_buffer("frequencies", frequencies.repeat(1, 1, 2))
        self.register_buffer("phases", torch.tensor([0.0, -math.pi / 2]).repeat_interleave(pairs))
        self.register_buffer("moved", (~kept).to(frequencies))
        self.gain = math.sqrt(1 / pairs)  # each pair of cosine and sine has norm 1
        self.weight = nn.Parameter(torch.zeros(layers, 2 * pairs, self._terms * 2 * dim))
        self.bias = nn.Parameter(torch.zeros(layers, self._terms * 2 * dim))

    def to_latent(self, x: State) -> State:
        """ψ(x)."""
        x, context = self._split(x)
        for frequencies, weight, bias in self._layers():
            squashed, shift, _ = self._condition(x, context, frequencies, weight, bias)
            x = x * self._scale(squashed) + shift
        return _join(x, context)

    def to_ambient(self, z: State) -> State:
        """ψ⁻¹(z)."""
        z, context = self._split(z)
        for frequencies, weight, bias in reversed(self._layers()):
            # kept coordinates are the same on both sides of a layer, so its conditioner can be asked again
            squashed, shift, _ = self._condition(z, context, frequencies, weight, bias)
            z = (z - shift) * self._scale(-squashed)
        return _join(z, context)

    def linearise(self, x: State) -> tuple[State, PushForward]:
        """ψ(x) and ż ↦ Dψ(x)⁻¹ ż."""
        x, context = self._split(x)
        tape = []
        for frequencies, weight, bias in self._layers():
            squashed, shift, angles = self._condition(x, context, frequencies, weight, bias)
            scale = self._scale(squashed)
            scaled = x * scale
            tape.append((frequencies, weight, angles, squashed, scale, scaled))
            x = scaled + shift

        def push_forward(tangent: Tensor) -> Tensor:
            # a tangent's kept coordinates pass a layer unchanged, so the angles' rates are known before it is undone
            tangent, still = self._split(tangent)
            for frequencies, weight, angles, squashed, scale, scaled in reversed(tape):
                falling = torch.sin(angles) * (tangent @ frequencies)  # minus the rate of the features
                raw, shift = _weighted(falling, weight, context).chunk(2, -1)
                log_scale = raw * (self.log_scale_cap - self.log_scale_cap * squashed * squashed)
                tangent = (tangent + scaled * log_scale + shift) / scale
            return _join(tangent, still)

        return _join(x, context), push_forward

    def _split(self, x: State) -> tuple[Tensor, Tensor | None]:
        """What is moved, and the context."""
        return (x, None) if self.context == 0 else (x[..., : -self.context], x[..., -self.context :])

    def _layers(self) -> list[tuple[Tensor, Tensor, Tensor]]:
        """Frequencies, weight and bias of each layer, with zeros where kept coordinates would be moved."""
        log_scales = self.moved / self.log_scale_cap
        weight_mask = torch.cat([log_scales, self.moved], -1).repeat(1, self._terms)
        weight = self.weight * (self.gain * weight_mask[:, None])
        bias = self.bias * (weight_mask if self.context == 0 else self._bias_mask(log_scales))
        return list(zip(self.frequencies.unbind(), weight.unbind(), bias.unbind(), strict=True))

    def _bias_mask(self, log_scales: Tensor) -> Tensor:
        """No shift without features, which vanish at the origin where there is context."""
        return torch.cat([log_scales, torch.zeros_like(log_scales)], -1).repeat(1, self._terms)

    def _condition(
        self, x: State, context: Tensor | None, frequencies: Tensor, weight: Tensor, bias: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """s / cap and t, zero for kept coordinates, and the angles behind them."""
        angles = x @ frequencies + self.phases
        features = torch.cos(angles)
        if context is None:
            raw, shift = (features @ weight + bias).chunk(2, -1)
        else:
            features = features - torch.cos(self.phases)
            raw, shift = (_weighted(features, weight, context) + combined(bias, context)).chunk(2, -1)
        return torch.tanh(raw), shift, angles

    def _scale(self, squashed: State) -> State:
        return (self.log_scale_cap * squashed).exp()


def _weighted(features: Tensor, weight: Tensor, context: Tensor | None) -> Tensor:
    """Features times W(c)."""
    return features @ weight if context is None else combined(features @ weight, context)


def combined(values: Float[Tensor, "*#batch terms"], context: Float[Tensor, "*batch K"]) -> Float[Tensor, "*batch out"]:
    """Σ cₖ vₖ of K vectors side by side."""
    terms: Tensor = values.unflatten(-1, (context.shape[-1], -1))  # type: ignore[no-untyped-call]
    return (terms * context[..., None]).sum(-2)


def _join(x: Tensor, context: Tensor | None) -> Tensor:
    return x if context is None else torch.cat([x, context], -1)


def alternating_halves(dim: int, layers: int) -> Bool[Tensor, "layer D"]:
    """Which coordinates each layer keeps: a half and then the other, a new random half for every pair of layers."""
    kept = torch.zeros(layers, dim, dtype=torch.bool)
    order = torch.arange(dim)
    for layer in range(layers):
        if layer % 2 == 0 and dim > 2:
            order = torch.randperm(dim)
        kept[layer, order[: dim // 2] if layer % 2 == 0 else order[dim // 2 :]] = True
    return kept


def normal_frequencies(count: int, dim: int, length_scales: Sequence[float]) -> Float[Tensor, "dim count"]:
    """Quasi-random samples of N(0, I / ℓ²), which cover the spectrum more evenly than random ones."""
    seed = int(torch.randint(2**31 - 1, ()))
    uniform = torch.quasirandom.SobolEngine(dim, scramble=True, seed=seed).draw(count, dtype=torch.float64)  # type: ignore[no-untyped-call]
    normal = torch.special.ndtri(uniform.clamp(TAIL, 1 - TAIL))
    scales = torch.tensor(length_scales, dtype=torch.float64)[torch.arange(count) % len(length_scales)]
    frequencies: Tensor = (normal / scales[:, None]).T.float()
    return frequencies
