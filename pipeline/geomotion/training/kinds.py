"""What training on poses and training on configurations differ in."""

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from geomotion.config import Antipodal, ManifoldConfig, ManifoldTraining
from geomotion.networks.joint_vae import JointVAE
from geomotion.networks.pose_vae import PoseVAE
from geomotion.training.manifold import (
    JointReconstruction,
    JointSpreadLikelihood,
    PoseReconstruction,
    SpreadLikelihood,
)
from geomotion.training.poses import PoseSpace, both_signs
from geomotion.training.states import TrainingSet
from geomotion.types import Tensor

Network = PoseVAE | JointVAE


@runtime_checkable
class Kind(Protocol):
    """What poses and configurations differ in."""

    def samples(self, mixed_copies: int, seed: int) -> tuple[Tensor, Tensor]:
        """Scaled states to train on and their progress."""
        ...

    def means(self, states: Tensor, progress: Tensor, training: ManifoldTraining) -> Any:
        """Objective of encoder and decoder."""
        ...

    def spreads(self, states: Tensor, progress: Tensor, training: ManifoldTraining) -> Any:
        """Objective of the spreads."""
        ...

    @property
    def orientation_at(self) -> int | None:
        """Where orientations begin in a state, if decoded ones have either sign."""
        ...


@dataclass(frozen=True)
class Poses:
    """Training on poses.

    Attributes:
        data: Demonstrations.
        space: Of poses.
        antipodal: What is done about q and -q being one orientation.
    """

    data: TrainingSet
    space: PoseSpace
    antipodal: Antipodal

    def samples(self, mixed_copies: int, seed: int) -> tuple[Tensor, Tensor]:
        states, progress = self.data.tensors(mixed_copies, seed)
        is_doubled = self.antipodal is not Antipodal.aligned
        return both_signs(states, progress, self.space.position_dim) if is_doubled else (states, progress)

    def means(self, states: Tensor, progress: Tensor, training: ManifoldTraining) -> PoseReconstruction:
        return PoseReconstruction(states, progress, training, self.antipodal)

    def spreads(self, states: Tensor, progress: Tensor, training: ManifoldTraining) -> SpreadLikelihood:
        return SpreadLikelihood(states, progress, training.batch_points, self.antipodal)

    @property
    def orientation_at(self) -> int | None:
        return self.space.position_dim if self.antipodal is Antipodal.mixture else None


@dataclass(frozen=True)
class Configurations:
    """Training on configurations.

    Attributes:
        data: Demonstrations.
    """

    data: TrainingSet
    orientation_at: int | None = None

    def samples(self, mixed_copies: int, seed: int) -> tuple[Tensor, Tensor]:
        return self.data.tensors(mixed_copies, seed)

    def means(self, states: Tensor, progress: Tensor, training: ManifoldTraining) -> JointReconstruction:
        return JointReconstruction(states, progress, training)

    def spreads(self, states: Tensor, progress: Tensor, training: ManifoldTraining) -> JointSpreadLikelihood:
        return JointSpreadLikelihood(states, progress, training.batch_points)


def kind_of(data: TrainingSet, config: ManifoldConfig) -> Kind:
    """How to train on some demonstrations."""
    if isinstance(data.space, PoseSpace):
        return Poses(data, data.space, config.antipodal)
    return Configurations(data)
