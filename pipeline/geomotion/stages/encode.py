"""Encode pictures once, by weights whose digest is kept."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from geomotion.config import ManipulationSkill
from geomotion.demos.snapshots import Snapshots
from geomotion.files import atomic, write_json
from geomotion.networks.image_encoder import ImageEncoder
from geomotion.pictured_skills import Eye
from geomotion.tracking import Artefacts, StageRun

logger = logging.getLogger("geomotion")


@dataclass(frozen=True)
class EncodeConfig:
    """What the encode stage needs.

    Attributes:
        weights: ``random``, a folder, or a name on the hub.
        tiles: Along each side of a picture.
        seed: Of random weights.
        weights_sha256: Of the parameters, where they are not random: what is behind the name of a folder may change.
    """

    weights: str
    tiles: int
    seed: int
    weights_sha256: str | None = None


def encode(config: EncodeConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``grasp.npz`` and ``drop.npz`` with features, and ``encoder.json``.

    Raises:
        MissingData: If there are no such weights; names the command that gets them.
    """
    encoder = ImageEncoder(config.weights, config.tiles, config.seed)
    logger.info("encode: ResNet-18 with %s", encoder.name)
    for skill in ManipulationSkill:
        pictures = Snapshots.load(inputs["snapshots"].path(f"{skill.value}.npz")).pictures
        features = Eye(encoder, pictures.shape[1]).features(pictures).numpy()
        with atomic(run.folder / f"{skill.value}.npz") as temporary:
            np.savez(temporary, allow_pickle=False, features=features)
    document = {"weights": encoder.name, "weights_sha256": encoder.digest, "tiles": config.tiles}
    write_json(run.folder / "encoder.json", document)
