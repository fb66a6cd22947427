"""A trained manifold as planning and geometry see it."""

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Bool, Float

from geomotion import config as schema
from geomotion.manifold_models import Skill, build
from geomotion.manifolds.density import DensityFactor, GroupedDensity, mean_distance_between
from geomotion.networks.joint_vae import JointVAE
from geomotion.planning.ends import Anchors
from geomotion.planning.manifold import DecodedPath
from geomotion.scores.paths import MotionPath, PosePath
from geomotion.training.poses import PoseSpace
from geomotion.training.states import TrainingSet
from geomotion.types import Tensor

Codes = Float[np.ndarray, "point d"]
MIXTURE_SEED = 0
ANCHOR_ROOM = 1.5  # times the demonstrated spread of starts: how near a start has to be to count as the same


class LearnedManifold:
    """In double precision, with states in metres and radians; a :class:`geomotion.planning.manifold.SkillManifold`.

    Args:
        skill: Trained.
        data: The demonstrations that it was fitted to.
        metric: Which metric.
    """

    def __init__(self, skill: Skill, data: TrainingSet, metric: schema.MetricConfig) -> None:
        self.network = build(skill.config, skill.space, seed=0).double()
        self.network.load_state_dict(skill.network.state_dict())
        self.network.eval().requires_grad_(False)
        self.latent_dim, self.space, self.scale_m = self.network.latent_dim, skill.space, skill.space.scale_m
        self._raw = metric.raw_concentration
        self.data = data
        self.codes = [self._encode(path, progress) for path, progress in zip(data.paths, data.progress, strict=True)]
        self.spacing = mean_distance_between(self.codes, data.groups)
        mixtures = data.mixtures(skill.config.mixed_copies, MIXTURE_SEED)
        codes = [*self.codes, *(self._encode(one.path, one.progress) for one in mixtures)]
        groups = [*data.groups, *(one.group for one in mixtures)]
        of_poses = [path for path in data.paths if isinstance(path, PosePath)]
        self.shows_both_signs = bool(of_poses) and skill.config.antipodal is not schema.Antipodal.aligned
        if self.shows_both_signs:  # the other sign has codes of its own
            signs = (PosePath(path.position_m, -path.orientation) for path in of_poses)
            codes += [self._encode(path, shares) for path, shares in zip(signs, data.progress, strict=True)]
            groups += list(data.groups)
            self.other_codes = torch.cat(codes[-len(data.paths) :]).numpy()
        else:
            self.other_codes = np.zeros((0, self.latent_dim))
        self.all_codes = torch.cat(codes).numpy()
        self._density = self._grouped_density(codes, groups, metric)

    # ------------------------------------------------------------ as arrays, for planning
    def decode(self, z: Codes) -> DecodedPath:
        """Mean states at latent points."""
        scaled, progress = self.network.reconstruct(_tensor(z))
        return DecodedPath(self.space.path(scaled.numpy()), progress.numpy())

    def embed(self, z: Codes) -> tuple[Float[np.ndarray, "point B P"], Float[np.ndarray, "point Q"]]:
        """Coordinates whose Euclidean metric is pulled back: those of each point that obstacles act on, and others."""
        position, rest = self.blocks(_tensor(z))
        return position.numpy(), rest.numpy()

    def stretch(self, z: Codes) -> Float[np.ndarray, " point"]:
        """Conformal factor f."""
        return np.asarray(self._density(_tensor(z)).numpy())

    def encode(self, state: MotionPath, progress: float) -> Codes:
        """Latent point of one state, shape (1, d)."""
        return np.asarray(self._encode(state, np.array([progress])).numpy())

    def allows(self, states: MotionPath) -> Bool[np.ndarray, " state"]:
        """Whether the robot can be in states at all."""
        return self.space.allows(states)

    def separation(self, states: MotionPath, one: MotionPath) -> Float[np.ndarray, " state"]:
        """Distances of states to one, in units of the manifold's scale."""
        return self.space.separation(states, one)

    def anchors(self, end: int) -> Anchors:
        """Where demonstrations of each group begin (0) or end (-1)."""
        codes, radii = [], []
        for group in dict.fromkeys(self.data.groups):
            members = [number for number, own in enumerate(self.data.groups) if own == group]
            codes.append(torch.stack([self.codes[number][end] for number in members]).mean(dim=0).numpy())
            there = self.decode(codes[-1][None]).states
            ends = (self.data.originals[number] for number in members)
            radii.append(max(float(self.space.separation(path[end:] if end else path[:1], there)[0]) for path in ends))
        return Anchors(np.stack(codes), self.decode(np.stack(codes)).states, ANCHOR_ROOM * np.array(radii))

    # ------------------------------------------------------------ as tensors, for derivatives
    def embedding(self, z: Tensor) -> Tensor:
        """All blocks side by side."""
        position, rest = self.blocks(z)
        return torch.cat([position.flatten(-2), rest], dim=-1)

    def conformal(self, z: Tensor) -> Tensor:
        """Conformal factor f."""
        return self._density(z)

    def blocks(self, z: Tensor) -> tuple[Tensor, Tensor]:
        """A block for each point that obstacles act on, and one for all else."""
        return self.network.blocks(z, self._raw)

    def positions(self, z: Tensor) -> Tensor:
        """Mean positions of the points that obstacles act on [m], shape (*batch, B, Dx)."""
        if isinstance(self.network, JointVAE):
            return self.network.positions(z)
        assert isinstance(self.space, PoseSpace)
        centre = torch.tensor(self.space.centre_m, dtype=z.dtype)
        return (self.network.decode(z).position * self.scale_m + centre)[..., None, :]

    def _grouped_density(
        self, codes: Sequence[Tensor], groups: Sequence[int], metric: schema.MetricConfig
    ) -> GroupedDensity:
        """Each group's kernels are as wide as its own demonstrations are apart."""
        factors = []
        for group in dict.fromkeys(groups):
            demonstrated = [one for one, own in zip(self.codes, self.data.groups, strict=True) if own == group]
            spacing = mean_distance_between(demonstrated, [group] * len(demonstrated))
            covered = torch.cat([one for one, own in zip(codes, groups, strict=True) if own == group])
            factors.append(DensityFactor(covered, metric.density_bandwidth * spacing, metric.density_power))
        return GroupedDensity(factors)

    def _encode(self, path: MotionPath, progress: Float[np.ndarray, " state"]) -> Tensor:
        return self.network.encode(_tensor(self.space.scaled(path)), torch.from_numpy(progress))[0]


def _tensor(values: Float[np.ndarray, "point k"]) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(values))
