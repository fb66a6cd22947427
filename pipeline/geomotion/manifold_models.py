"""Pose manifolds from configuration, the file they are kept in, and what planning asks of them."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float

from geomotion import config as schema
from geomotion.errors import CorruptArtefact
from geomotion.files import write_tensors
from geomotion.manifolds.density import DensityFactor, GroupedDensity, mean_distance_between
from geomotion.networks.pose_vae import PoseVAE
from geomotion.planning.manifold import DecodedPath
from geomotion.planning.planner import Anchors
from geomotion.scores.paths import PosePath
from geomotion.training.poses import PoseGeometry, PoseTrainingSet
from geomotion.types import Tensor

FORMAT = 1
Codes = Float[np.ndarray, "point d"]


@dataclass(frozen=True)
class PoseSkill:
    """A trained manifold with what is needed to use and to judge it.

    Attributes:
        network: Encoder, decoder and spreads.
        config: Architecture.
        geometry: Place and size of the demonstrations.
        train_demos: Numbers of the demonstrations it was fitted to.
        test_demos: Numbers of those that were held out.
    """

    network: PoseVAE
    config: schema.ManifoldConfig
    geometry: PoseGeometry
    train_demos: tuple[int, ...]
    test_demos: tuple[int, ...]


def build(config: schema.ManifoldConfig, geometry: PoseGeometry, seed: int) -> PoseVAE:
    """An untrained network; the same seed gives the same parameters."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return PoseVAE(
            geometry.position_dim,
            geometry.orientation_dim,
            config.latent_dim,
            config.hidden_units,
            config.kernels,
            config.largest_std,
            config.smallest_concentration,
            config.encode_progress,
        )


def save(path: Path, skill: PoseSkill) -> None:
    """Write a manifold: parameters, architecture and scaling in one file."""
    document = {
        "format": FORMAT,
        "kind": "pose manifold",
        "config": schema.plain(skill.config),
        "geometry": asdict(skill.geometry),
        "train_demos": list(skill.train_demos),
        "test_demos": list(skill.test_demos),
        "parameters": skill.network.state_dict(),
    }
    write_tensors(path, document)


def load(path: Path) -> PoseSkill:
    """Read a manifold.

    Raises:
        CorruptArtefact: If the file is damaged or of another format.
    """
    try:
        document = torch.load(path, weights_only=True)
        if (document["format"], document["kind"]) != (FORMAT, "pose manifold"):
            raise CorruptArtefact(path, f"format {document['format']}, this version reads {FORMAT}")
        config = _config(document["config"])
        geometry = PoseGeometry(**{**document["geometry"], "centre_m": tuple(document["geometry"]["centre_m"])})
        network = build(config, geometry, seed=0)
        network.load_state_dict(document["parameters"])
    except CorruptArtefact:
        raise
    except Exception as error:  # torch reports damage by many types
        raise CorruptArtefact(path, "this manifold cannot be read") from error
    network.eval()
    return PoseSkill(network, config, geometry, tuple(document["train_demos"]), tuple(document["test_demos"]))


def _config(document: Mapping[str, Any]) -> schema.ManifoldConfig:
    values = {name: value for name, value in document.items() if name != "kind"}
    return schema.ManifoldConfig(**{**values, "antipodal": schema.Antipodal(values["antipodal"])})


class PoseManifold:
    """A trained manifold for planning and for geometry: in double precision, with poses in metres.

    Args:
        skill: Trained.
        data: The demonstrations that it was fitted to.
        metric: Which metric.
    """

    def __init__(self, skill: PoseSkill, data: PoseTrainingSet, metric: schema.MetricConfig) -> None:
        self.network = build(skill.config, skill.geometry, seed=0).double()
        self.network.load_state_dict(skill.network.state_dict())
        self.network.eval().requires_grad_(False)
        self.latent_dim, self.scale_m = skill.config.latent_dim, skill.geometry.scale_m
        self._centre_m = torch.tensor(skill.geometry.centre_m, dtype=torch.float64)
        self._raw = metric.raw_concentration
        self.data = data
        self.codes = [self._encode(path, progress) for path, progress in zip(data.paths, data.progress, strict=True)]
        self.spacing = mean_distance_between(self.codes, data.groups)
        mixtures = data.mixtures(skill.config.mixed_copies, MIXTURE_SEED)
        codes = [*self.codes, *(self._encode(one.path, one.progress) for one in mixtures)]
        groups = [*data.groups, *(one.group for one in mixtures)]
        self.shows_both_signs = skill.config.antipodal is not schema.Antipodal.aligned
        if self.shows_both_signs:  # the other sign has codes of its own
            signs = (PosePath(path.position_m, -path.orientation) for path in data.paths)
            codes += [self._encode(path, shares) for path, shares in zip(signs, data.progress, strict=True)]
            groups += list(data.groups)
            self.other_codes = torch.cat(codes[-len(data.paths) :]).numpy()
        else:
            self.other_codes = np.zeros((0, self.latent_dim))
        self.all_codes = torch.cat(codes).numpy()
        self._density = self._grouped_density(codes, groups, metric)

    # ------------------------------------------------------------ as arrays, for planning
    def decode(self, z: Codes) -> DecodedPath:
        """Mean poses at latent points."""
        decoded = self.network.decode(torch.from_numpy(np.ascontiguousarray(z)))
        position = decoded.position * self.scale_m + self._centre_m
        return DecodedPath(PosePath(position.numpy(), decoded.orientation.numpy()), decoded.progress.numpy())

    def embed(self, z: Codes) -> tuple[Float[np.ndarray, "point P"], Float[np.ndarray, "point Q"]]:
        """Coordinates whose Euclidean metric is pulled back: those of positions, and the others."""
        position, rest = self.blocks(torch.from_numpy(np.ascontiguousarray(z)))
        return position.numpy(), rest.numpy()

    def stretch(self, z: Codes) -> Float[np.ndarray, " point"]:
        """Conformal factor f."""
        return np.asarray(self._density(torch.from_numpy(np.ascontiguousarray(z))).numpy())

    def encode(self, pose: PosePath, progress: float) -> Codes:
        """Latent point of one pose, shape (1, d)."""
        return np.asarray(self._encode(pose, np.array([progress])).numpy())

    def anchors(self, end: int) -> Anchors:
        """Where demonstrations of each group begin (0) or end (-1)."""
        codes, poses, radii = [], [], []
        for group in dict.fromkeys(self.data.groups):
            members = [number for number, own in enumerate(self.data.groups) if own == group]
            code = torch.stack([self.codes[number][end] for number in members]).mean(dim=0)
            codes.append(code.numpy())
            pose = self.decode(code.numpy()[None]).poses
            poses.append(pose)
            radii.append(max(self._separation(self.data.originals[number], end, pose) for number in members))
        together = PosePath(
            np.concatenate([pose.position_m for pose in poses]), np.concatenate([pose.orientation for pose in poses])
        )
        return Anchors(np.stack(codes), together, ANCHOR_ROOM * np.array(radii))

    def _separation(self, path: PosePath, end: int, pose: PosePath) -> float:
        across = np.linalg.norm(path.position_m[end] - pose.position_m[0]) / self.scale_m
        cosine = abs(float(path.orientation[end] @ pose.orientation[0]))
        return float(np.hypot(across, np.sqrt(2 * (1 - min(cosine, 1.0)))))

    # ------------------------------------------------------------ as tensors, for derivatives
    def embedding(self, z: Tensor) -> Tensor:
        """Both blocks side by side."""
        return torch.cat(self.blocks(z), dim=-1)

    def conformal(self, z: Tensor) -> Tensor:
        """Conformal factor f."""
        return self._density(z)

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

    def blocks(self, z: Tensor) -> tuple[Tensor, Tensor]:
        """Position block and orientation block."""
        return self.network.embed_position(z), self.network.embed_orientation(z, self._raw)

    def position(self, z: Tensor) -> Tensor:
        """Mean position [m]."""
        return self.network.decode(z).position * self.scale_m + self._centre_m

    def _encode(self, path: PosePath, progress: Float[np.ndarray, " pose"]) -> Tensor:
        poses = self.data.geometry.scaled(path)
        return self.network.encode(torch.from_numpy(poses), torch.from_numpy(progress))[0]


MIXTURE_SEED = 0
ANCHOR_ROOM = 1.5  # times the demonstrated spread of starts: how near a start has to be to count as the same
