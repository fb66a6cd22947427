"""Manifolds from configuration, and the file they are kept in."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeVar

import torch

from geomotion import arms
from geomotion import config as schema
from geomotion.errors import CorruptArtefact
from geomotion.files import write_tensors
from geomotion.networks.joint_vae import JointVAE
from geomotion.networks.pose_vae import PoseVAE
from geomotion.robot.kinematics import ForwardKinematics
from geomotion.training.configurations import ConfigurationSpace
from geomotion.training.kinds import Network
from geomotion.training.poses import PoseSpace
from geomotion.training.states import StateSpace

C = TypeVar("C")
FORMAT = 2
ARMS: dict[str, type[schema.ArmConfig]] = {
    kind.__name__: kind for kind in (schema.PandaArm, schema.PlanarArm, schema.UrdfArm)
}
KIND = "manifold"
POSE_DIM, JOINT_DIM = 2, 3  # of the latent space, if the configuration leaves it open; Sec. 3.5.5, 4.3.2


@dataclass(frozen=True)
class Skill:
    """A trained manifold with what is needed to use and to judge it.

    Attributes:
        network: Encoder, decoder and spreads.
        config: Architecture, its latent dimension settled.
        space: Where its states live, with place and size of the demonstrations.
        train_demos: Numbers of the demonstrations it was fitted to.
        test_demos: Numbers of those that were held out.
        arm: Whose configurations it holds; None for poses.
    """

    network: Network
    config: schema.ManifoldConfig
    space: StateSpace
    train_demos: tuple[int, ...]
    test_demos: tuple[int, ...]
    arm: schema.ArmConfig | None = None


def settled(config: schema.ManifoldConfig, arm: schema.ArmConfig | None) -> schema.ManifoldConfig:
    """The configuration with what it leaves to the kind of states: poses, or configurations of an arm."""
    if config.latent_dim is not None:
        return config
    dim = POSE_DIM if arm is None else max(POSE_DIM, min(JOINT_DIM, len(arms.build(arm).joint_names)))
    return replace(config, latent_dim=dim)


def build(config: schema.ManifoldConfig, space: StateSpace, seed: int) -> Network:
    """An untrained network; the same seed gives the same parameters."""
    dim = config.latent_dim
    assert dim is not None, "settled() comes first"
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        if isinstance(space, PoseSpace):
            return PoseVAE(
                space.position_dim,
                space.orientation_dim,
                dim,
                config.hidden_units,
                config.kernels,
                config.largest_std,
                config.smallest_concentration,
                config.encode_progress,
            )
        assert isinstance(space, ConfigurationSpace)
        return JointVAE(
            ForwardKinematics(space.arm, space.arm.joint_points(config.points_between_joints)),
            space.centre_rad,
            space.scale_rad,
            space.scale_m,
            dim,
            config.hidden_units,
            config.kernels,
            config.largest_std,
            config.encode_progress,
        )


def save(path: Path, skill: Skill) -> None:
    """Write a manifold: parameters, architecture and scaling in one file."""
    document = {
        "format": FORMAT,
        "kind": KIND,
        "config": schema.plain(skill.config),
        "space": skill.space.document(),
        "arm": None if skill.arm is None else schema.plain(skill.arm),
        "train_demos": list(skill.train_demos),
        "test_demos": list(skill.test_demos),
        "parameters": skill.network.state_dict(),
    }
    write_tensors(path, document)


def load(path: Path) -> Skill:
    """Read a manifold.

    Raises:
        CorruptArtefact: If the file is damaged or of another format.
    """
    try:
        document = torch.load(path, weights_only=True)
        if (document["format"], document["kind"]) != (FORMAT, KIND):
            raise CorruptArtefact(path, f"format {document['format']}, this version reads {FORMAT}")
        config = _config(document["config"])
        arm = None if document["arm"] is None else _filled(ARMS[document["arm"]["kind"]], document["arm"])
        space = _space(document["space"], arm)
        network = build(config, space, seed=0)
        network.load_state_dict(document["parameters"])
    except CorruptArtefact:
        raise
    except Exception as error:  # torch reports damage by many types
        raise CorruptArtefact(path, "this manifold cannot be read") from error
    network.eval()
    return Skill(network, config, space, tuple(document["train_demos"]), tuple(document["test_demos"]), arm)


def _config(document: Mapping[str, Any]) -> schema.ManifoldConfig:
    return _filled(schema.ManifoldConfig, {**document, "antipodal": schema.Antipodal(document["antipodal"])})


def _filled(kind: type[C], document: Mapping[str, Any]) -> C:
    """A configuration from its fields as JSON types."""
    return kind(**{item.name: document[item.name] for item in fields(kind)})  # type: ignore[arg-type]


def _space(document: Mapping[str, Any], arm: schema.ArmConfig | None) -> StateSpace:
    values: dict[str, Any] = {name: tuple(one) if isinstance(one, list) else one for name, one in document.items()}
    return PoseSpace(**values) if arm is None else ConfigurationSpace(**values, arm=arms.build(arm))
