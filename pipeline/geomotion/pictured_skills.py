"""Policies that look: a picture gives the condition, the condition and the state give the velocity."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import UInt8

from geomotion import conditional_models
from geomotion.conditional_models import ConditionalPolicy, ConditionalSkill
from geomotion.demos.generators.panda_grasp_and_drop import DOWN_WXYZ
from geomotion.demos.snapshots import check_pictures, digest_of_picture
from geomotion.errors import CorruptArtefact
from geomotion.files import write_tensors
from geomotion.networks.image_encoder import ImageEncoder
from geomotion.robot.disturbances import Measured
from geomotion.robot.field_policy import PositionStates
from geomotion.robot.resolved_rate import TipVelocity
from geomotion.training.embedding import Embedding
from geomotion.types import Float, Tensor

Picture = UInt8[np.ndarray, "height width 3"]
Condition = Float[np.ndarray, " K"]
SAME_M = 0.05  # sightings nearer to each other than this are of one place


@dataclass
class Eye:
    """An encoder with a memory of what it has seen.

    Attributes:
        encoder: Frozen.
        side_px: Height and width of the pictures that embeddings were trained on.
    """

    encoder: ImageEncoder
    side_px: int

    def __post_init__(self) -> None:
        self._known: dict[str, Tensor] = {}

    def features(self, pictures: UInt8[np.ndarray, "picture height width 3"]) -> Float[Tensor, "picture feature"]:
        """Features of pictures; equal pictures are encoded once.

        Raises:
            ShapeMismatch: If they are not RGB with eight bits a channel, or of another size.
        """
        check_pictures(pictures, self.side_px)
        digests = [digest_of_picture(picture) for picture in pictures]
        new = {digest: row for row, digest in enumerate(digests) if digest not in self._known}
        if new:
            found = self.encoder(pictures[list(new.values())])
            self._known.update(zip(new, found, strict=True))
        return torch.stack([self._known[digest] for digest in digests])


@dataclass
class Sighting:
    """Where the object was seen, over several pictures.

    Pictures that agree are averaged. One that disagrees may be a mistake: only a second one that agrees with it means
    that the object was moved.

    Attributes:
        goal_m: Where the motion leads under a condition.
    """

    goal_m: Callable[[Condition], Float[np.ndarray, " D"]]

    def __post_init__(self) -> None:
        self._agreeing: list[Condition] = []
        self._doubtful: Condition | None = None

    def note(self, seen: Condition) -> Condition:
        """What is to be believed after one more picture."""
        if not self._agreeing or self._is_near(seen, self.believed):
            self._agreeing.append(seen)
            self._doubtful = None
        elif self._doubtful is not None and self._is_near(seen, self._doubtful):
            self._agreeing, self._doubtful = [self._doubtful, seen], None
        else:
            self._doubtful = seen
        return self.believed

    @property
    def believed(self) -> Condition:
        """The mean of pictures that agree."""
        return np.asarray(np.mean(self._agreeing, axis=0))

    def _is_near(self, one: Condition, other: Condition) -> bool:
        return bool(np.linalg.norm(self.goal_m(one) - self.goal_m(other)) < SAME_M)


class PicturedPolicy:
    """One skill under what was seen last: velocities of the tip, whose orientation is held pointing down.

    Args:
        skill: Of positions in space, conditional.
        embedding: From features to its condition.
        eye: From pictures to features.
    """

    def __init__(self, skill: ConditionalSkill, embedding: Embedding, eye: Eye) -> None:
        self.skill, self.embedding, self.eye = skill, embedding.eval(), eye
        self.policy = ConditionalPolicy(skill).eval()
        self.states = PositionStates(np.array(DOWN_WXYZ))
        self.begin()

    def begin(self) -> None:
        """Forget what was seen before."""
        self._sighting = Sighting(self.skill.conditioning.goal_at)
        self.condition: Condition = np.full(self.embedding.places, 1 / self.embedding.places)

    @torch.no_grad()
    def look(self, picture: Picture) -> Condition:
        """Take the condition from a picture, and from those before it since the motion began.

        Raises:
            ShapeMismatch: If it is not RGB with eight bits a channel, or of another size than those trained on.
        """
        seen = self.embedding(self.eye.features(picture[None])[0]).double().numpy()
        self.condition = self._sighting.note(seen)
        return self.condition

    @property
    def goal_m(self) -> Float[np.ndarray, "3"]:
        """Where the motion leads under this condition."""
        return self.skill.conditioning.goal_at(self.condition)

    @torch.no_grad()
    def __call__(self, measured: Measured, time_s: float) -> TipVelocity:
        """Velocity of the tip at a time since the start of the motion [s]."""
        x = self.states.state(measured)
        condition = torch.tensor(self.condition, dtype=torch.float32)
        velocity = self.policy(torch.tensor(x, dtype=torch.float32), condition, torch.tensor([time_s]))
        return self.states.command(x, velocity.double().numpy(), measured)


def save_embedding(path: Path, embedding: Embedding) -> None:
    """Write the layer."""
    document = {
        "places": embedding.places,
        "knows_elsewhere": embedding.knows_elsewhere,
        "features": embedding.layer.in_features,
        "parameters": embedding.state_dict(),
    }
    write_tensors(path, document)


def load_embedding(path: Path) -> Embedding:
    """Read the layer.

    Raises:
        CorruptArtefact: If the file is damaged, or of something else.
    """
    try:
        document = torch.load(path, weights_only=True)
        embedding = Embedding(document["features"], document["places"], document["knows_elsewhere"])
        embedding.load_state_dict(document["parameters"])
    except Exception as error:  # torch reports damage by many types
        raise CorruptArtefact(path, "it holds no embedding of pictures") from error
    return embedding.eval()


def load_policy(model: Path, embedding: Path, eye: Eye) -> PicturedPolicy:
    """A policy from its two files.

    Raises:
        CorruptArtefact: If one is damaged, or the model has no conditions.
    """
    skill = conditional_models.load(model)
    if not isinstance(skill, ConditionalSkill):
        raise CorruptArtefact(model, "this model has no conditions")
    return PicturedPolicy(skill, load_embedding(embedding), eye)
