"""ResNet-18 as a frozen encoder of pictures: 1000 numbers of each.

Weights are those of a folder, or of a name on the Hugging Face hub once they were downloaded; or seeded random ones,
which still tell pictures apart. Nothing is downloaded here, and random weights never replace missing ones.

Source: He, Zhang, Ren, Sun (2016), Deep residual learning for image recognition; Thesis Sec. 6.4.8.
"""

import hashlib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from geomotion.errors import InvalidSetting, MissingData
from geomotion.types import Float, Tensor

RANDOM = "random"
HUB_NAME = "microsoft/resnet-18"
FEATURES = 1000
MEAN, STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)  # of ImageNet's pictures, red, green and blue
BATCH = 32
OVERLAP = 0.5  # of neighbouring tiles


class ImageEncoder(nn.Module):
    """A picture, or overlapping tiles of it, to the 1000 outputs of ResNet-18 for each.

    Args:
        weights: ``random``, a folder, or a name on the hub of what was downloaded.
        tiles: Number along each side; 1 is the picture itself.
        seed: Of random weights.

    Attributes:
        digest: SHA-256 of the parameters.
        name: What the weights are, for people.

    Raises:
        MissingData: If there are no such weights; names the command that gets them.
        InvalidSetting: If they cannot be read, are those of another network, or not all of this one.
    """

    def __init__(self, weights: str, tiles: int = 1, seed: int = 0) -> None:
        super().__init__()
        self.tiles = tiles
        untrained = f"random weights, untrained (encoder.weights=random, seed {seed})"
        self.name = untrained if weights == RANDOM else weights
        self.network = (_random(seed) if weights == RANDOM else _stored(weights)).eval().requires_grad_(False)
        self.digest = _digest(self.network)
        self.register_buffer("mean", torch.tensor(MEAN)[:, None, None])
        self.register_buffer("std", torch.tensor(STD)[:, None, None])

    @property
    def width(self) -> int:
        """Numbers of each picture."""
        return FEATURES * self.tiles**2

    @torch.no_grad()
    def forward(self, pictures: np.ndarray) -> Float[Tensor, "picture feature"]:
        """Features of RGB pictures, shape (picture, height, width, 3) uint8."""
        parts = [self._features(pictures[begin : begin + BATCH]) for begin in range(0, len(pictures), BATCH)]
        return torch.cat(parts)

    def _features(self, pictures: np.ndarray) -> Float[Tensor, "picture feature"]:
        scaled = torch.from_numpy(pictures).permute(0, 3, 1, 2).float() / 255
        normal = (scaled - self.get_buffer("mean")) / self.get_buffer("std")
        corners = _corners(normal.shape[-1], self.tiles)
        size = normal.shape[-1] - corners[-1]
        tiles = [normal[..., top : top + size, left : left + size] for top in corners for left in corners]
        return torch.cat([self.network(tile).logits for tile in tiles], dim=1)


def _corners(side: int, tiles: int) -> list[int]:
    """Where square tiles begin that overlap by half and cover a side."""
    size = side if tiles == 1 else round(side / (1 + (tiles - 1) * OVERLAP))
    return [round(corner) for corner in np.linspace(0, side - size, tiles)]


def _random(seed: int) -> Any:
    from transformers import ResNetConfig, ResNetForImageClassification

    layers: dict[str, Any] = {"depths": [2, 2, 2, 2], "hidden_sizes": [64, 128, 256, 512], "layer_type": "basic"}
    config = ResNetConfig(**layers | {"num_labels": FEATURES})
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return ResNetForImageClassification(config)


def _stored(weights: str) -> Any:
    from transformers import ResNetForImageClassification

    read: Any = ResNetForImageClassification.from_pretrained
    folder = Path(weights).expanduser()
    is_folder = folder.is_dir() or weights.startswith((".", "/", "~"))
    try:
        where = str(folder) if is_folder else weights
        network, loaded = read(where, local_files_only=True, output_loading_info=True, ignore_mismatched_sizes=True)
    except (OSError, ValueError) as error:
        command = f"{HUB_NAME} --local-dir {folder}" if is_folder else weights
        how = f"Get them where there is a network: `hf download {command}`. Untrained ones: encoder.weights=random."
        raise MissingData(f"ResNet-18 weights {weights!r}", how) from error
    except Exception as error:  # the library that reads them has a type of its own for damage
        raise InvalidSetting("encoder.weights", weights, f"weights that can be read ({error})") from error
    expected = f"ResNet-18 with {FEATURES} outputs"
    outputs = network.config.num_labels
    if outputs != FEATURES:
        raise InvalidSetting("encoder.weights", weights, f"{expected}; this network has {outputs}")
    if lacking := [*loaded["missing_keys"], *(str(name) for name, *_ in loaded["mismatched_keys"])]:
        raise InvalidSetting("encoder.weights", weights, f"{expected}; these lack {', '.join(sorted(lacking)[:3])}")
    return network


@cache
def digest_of_weights(weights: str) -> str:
    """SHA-256 of the parameters of stored weights, read once in a process.

    Raises:
        MissingData: As of :class:`ImageEncoder`.
        InvalidSetting: Likewise.
    """
    return ImageEncoder(weights).digest


def _digest(network: nn.Module) -> str:
    digest = hashlib.sha256()
    for name, values in sorted(network.state_dict().items()):
        digest.update(name.encode() + values.numpy().tobytes())
    return digest.hexdigest()
