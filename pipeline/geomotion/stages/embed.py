"""Fit what turns the features of a picture into the condition of a skill, and judge it on pictures it has not seen."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from geomotion import conditional_models
from geomotion.conditional_models import ConditionalPolicy, ConditionalSkill
from geomotion.config import EncoderConfig, ManipulationSkill
from geomotion.demos import storage
from geomotion.demos.generators.panda_grasp_and_drop import PLACES_M
from geomotion.demos.snapshots import BETWEEN, Snapshots
from geomotion.errors import CorruptArtefact
from geomotion.files import read_json, write_json
from geomotion.pictured_skills import save_embedding
from geomotion.tracking import Artefacts, StageRun
from geomotion.training.data import TrainingSet
from geomotion.training.embedding import Embedding, Seen, Shown, barycentric, fit_embedding

TEST_EVERY = 5  # of the pictures, one is not trained on


@dataclass(frozen=True)
class EmbedConfig:
    """What the embed stage needs."""

    encoder: EncoderConfig
    skill: ManipulationSkill


def embed(config: EmbedConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``embedding.pt`` and ``embedding.json``.

    Raises:
        CorruptArtefact: If the model has no conditions.
    """
    skill = conditional_models.load(inputs["train"].path("model.pt"))
    if not isinstance(skill, ConditionalSkill):
        raise CorruptArtefact(inputs["train"].path("model.pt"), "this model has no conditions")
    name = f"{config.skill.value}.npz"
    pictures = Snapshots.load(inputs["snapshots"].path(name))
    with np.load(inputs["encode"].path(name), allow_pickle=False) as found:
        features = torch.from_numpy(found["features"])
    is_test = _held_out(pictures)
    seen = Seen(features, torch.from_numpy(pictures.place), torch.from_numpy(barycentric(pictures.object_m, PLACES_M)))
    trained = _rows(seen, ~is_test)
    embedding, losses = fit_embedding(trained, _shown(skill, inputs), config.encoder)
    save_embedding(run.folder / "embedding.pt", embedding)
    document = {
        "skill": config.skill.value,
        "encoder": read_json(inputs["encode"].path("encoder.json")),
        "losses": losses,
        "knows_elsewhere": embedding.knows_elsewhere,
        "training_pictures": int((~is_test).sum()),
        "held_out": _judged(embedding, _rows(seen, is_test), pictures.object_m[is_test]),
    }
    write_json(run.folder / "embedding.json", document)
    run.log_series(0, {f"embedding.loss.{key}": value for key, value in losses.items()})


def _held_out(pictures: Snapshots) -> np.ndarray:
    """The last of each place, with the hand at rest and on its way: one of five, or of fewer one, unless it is all."""
    is_test = np.zeros(len(pictures), dtype=bool)
    kinds = 2 * pictures.place + pictures.is_on_the_way
    for kind in np.unique(kinds):
        rows = np.flatnonzero(kinds == kind)
        count = min(max(1, len(rows) // TEST_EVERY), len(rows) - 1)
        is_test[rows[len(rows) - count :]] = True
    return is_test


def _rows(seen: Seen, chosen: np.ndarray) -> Seen:
    rows = torch.from_numpy(chosen)
    return Seen(seen.features[rows], seen.place[rows], seen.coordinates[rows])


def _shown(skill: ConditionalSkill, inputs: Mapping[str, Artefacts]) -> Shown:
    demonstrations = storage.load(inputs["ingest"].folder).select(skill.augmented.train_demos)
    place = np.array([int(np.argmax(one.condition)) for one in demonstrations.trajectories])
    data = TrainingSet.from_demonstrations(demonstrations, skill.augmented.state_channels)
    return Shown(ConditionalPolicy(skill).eval().requires_grad_(False), data, place, skill.augmented.geometry.scale_m)


@torch.no_grad()
def _judged(embedding: Embedding, seen: Seen, object_m: np.ndarray) -> dict[str, Any]:
    """Confusion of places, and how far from the object the condition says that it is."""
    scores = embedding.scores(seen.features).numpy()
    place, count = seen.place.numpy(), embedding.places
    confusion = np.zeros((scores.shape[1],) * 2, dtype=int)
    np.add.at(confusion, (np.where(place == BETWEEN, count, place), scores.argmax(-1)), 1)
    apart_m = np.linalg.norm(embedding(seen.features).double().numpy() @ PLACES_M - object_m, axis=1)
    found: dict[str, Any] = {"confusion": confusion.tolist()}
    for name, rows in (("places", place != BETWEEN), ("between", place == BETWEEN)):
        if rows.any():
            median, high = np.quantile(apart_m[rows], [0.5, 0.95])
            found[name] = {"pictures": int(rows.sum()), "median_m": float(median), "95_percent_m": float(high)}
    found["place_accuracy"] = float((scores[:, :count].argmax(-1) == place)[place != BETWEEN].mean())
    return found
