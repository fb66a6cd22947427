"""Encode pictures once: features by the digest of each picture, and of the weights."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from geomotion.config import ManipulationSkill
from geomotion.demos.snapshots import Snapshots, digest_of_picture
from geomotion.files import atomic, write_json
from geomotion.networks.image_encoder import ImageEncoder
from geomotion.tracking import Artefacts, StageRun

logger = logging.getLogger("geomotion")


@dataclass(frozen=True)
class EncodeConfig:
    """What the encode stage needs.

    Attributes:
        weights: ``random``, a folder, or a name on the hub.
        tiles: Along each side of a picture.
        seed: Of random weights.
    """

    weights: str
    tiles: int
    seed: int


def encode(config: EncodeConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``grasp.npz`` and ``drop.npz`` with features and picture digests, and ``encoder.json``.

    Raises:
        MissingData: If there are no such weights; names the command that gets them.
    """
    encoder = ImageEncoder(config.weights, config.tiles, config.seed)
    logger.info("encode: ResNet-18 with %s", encoder.name)
    known: dict[str, np.ndarray] = {}
    for skill in ManipulationSkill:
        pictures = Snapshots.load(inputs["snapshots"].path(f"{skill.value}.npz")).pictures
        digests = [digest_of_picture(picture) for picture in pictures]
        new = {digest: row for row, digest in enumerate(digests) if digest not in known}
        if new:
            known |= dict(zip(new, encoder(pictures[list(new.values())]).numpy(), strict=True))
        with atomic(run.folder / f"{skill.value}.npz") as temporary:
            features = np.stack([known[digest] for digest in digests])
            np.savez(temporary, allow_pickle=False, features=features, digests=np.array(digests))
    document = {"weights": encoder.name, "weights_sha256": encoder.digest, "tiles": config.tiles}
    write_json(run.folder / "encoder.json", document)
