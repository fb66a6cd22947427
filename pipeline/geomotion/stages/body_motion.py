"""Draw a body that the skill moves, as a picture and as a film."""

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from geomotion import models
from geomotion.config import BodyConfig
from geomotion.demos import storage
from geomotion.demos.demonstrations import Array, Demonstrations, Trajectory
from geomotion.demos.pose_vectors import with_pose_vectors
from geomotion.figures.body import BodyPicture, figure_body, film_frames
from geomotion.figures.style import save_figure
from geomotion.files import read_json
from geomotion.models import Skill
from geomotion.robot.film import save_gif
from geomotion.robot.skeleton import Skeleton
from geomotion.scores.array_field import ArrayField
from geomotion.scores.joints import ReturnProtocol
from geomotion.stages.ingest import SKELETON
from geomotion.tracking import Artefacts, StageRun

FORWARD = np.array([0.0, 1.0, 0.0])  # of the body, in the frame of its root
OWN_START = "led by the skill from the demonstration's start"
RANDOM_SIDES = 3  # the first two starts of the protocol are off to one side each


def draw_body_motion(config: BodyConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``figures/body`` and ``film.gif``: the first training demonstration, and what the skill makes of it.

    Needs ``skeleton.json`` of the stage ``ingest``, and a skill of joints.
    """
    skill = models.load(inputs["train"].path("model.pt"))
    skeleton = Skeleton.from_document(read_json(inputs["ingest"].path(SKELETON))["nodes"])
    demonstrations = with_pose_vectors(storage.load(inputs["ingest"].folder), skill.pose)
    picture = body_picture(config, skill, skeleton, demonstrations)
    save_figure(figure_body(picture, config.snapshots), run.folder / "figures", "body", picture.arrays())
    if config.film:
        save_gif(film_frames(picture, config.film_fps), run.folder / "film.gif", config.film_fps)


def body_picture(config: BodyConfig, skill: Skill, skeleton: Skeleton, demonstrations: Demonstrations) -> BodyPicture:
    """The demonstration, the motion from its start, and one from a start that is off in every joint."""
    one = demonstrations[skill.train_demos[0]]
    states, time_s = one.state(skill.state_channels), one.time_s - one.time_s[0]
    offset = ReturnProtocol(RANDOM_SIDES, config.offset_rad, config.seed).offsets(skill.joints)[-1]
    starts = np.stack([states[0], states[0]])
    starts[1, : skill.joints] += offset
    rolled = ArrayField(skill.field).exact().roll(starts, time_s)
    names = demonstrations.joint_names
    shown = [_places(skeleton, skill, names, one, motion) for motion in (states, *rolled)]
    titles = (OWN_START, f"from {config.offset_rad:g} rad beside it in every joint")
    orientation = one.channels.get("orientation_wxyz", np.array([[1.0, 0.0, 0.0, 0.0]]))
    return BodyPicture(
        time_s, shown[0], dict(zip(titles, shown[1:], strict=True)), skeleton.bones(), _facing(orientation)
    )


def _places(skeleton: Skeleton, skill: Skill, names: Sequence[str], one: Trajectory, states: Array) -> Array:
    """Nodes of the body [m]; where the skill does not lead the root, it stays where the demonstration starts."""
    if skill.pose is not None:
        position, orientation = (
            part.numpy() for part in skill.pose.to_pose(torch.as_tensor(states[:, skill.joints :]))
        )
    else:
        position, orientation = _standing(one, len(states))
    return skeleton.positions(states[:, : skill.joints], names, position, orientation)


def _standing(one: Trajectory, times: int) -> tuple[Array, Array]:
    position, orientation = np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]])
    if "orientation_wxyz" in one.channels:
        position, orientation = one.channels["position_m"][:1], one.channels["orientation_wxyz"][:1]
    return np.repeat(position, times, axis=0), np.repeat(orientation, times, axis=0)


def _facing(orientation_wxyz: Array) -> Array:
    """The mean horizontal direction that a body faces."""
    facing = Rotation.from_quat(orientation_wxyz, scalar_first=True).apply(FORWARD).mean(axis=0) * [1.0, 1.0, 0.0]
    length = float(np.linalg.norm(facing))
    return facing / length if length > 0 else FORWARD
