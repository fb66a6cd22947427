"""Joints with the pose of what carries them, through the stages; and the body drawn."""

import numpy as np
import pytest

from geomotion import config as schema
from geomotion import models
from geomotion.demos import storage
from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.demos.pose_vectors import with_pose_vectors
from geomotion.demos.preprocessing import preprocess
from geomotion.errors import DatasetError, InvalidSetting
from geomotion.export import OnnxPolicy
from geomotion.files import read_json, write_json
from geomotion.models import ModelConfig
from geomotion.robot.skeleton import Node, Skeleton
from geomotion.stages.body_motion import draw_body_motion
from geomotion.stages.evaluate import compute
from geomotion.stages.export import ExportConfig, export
from geomotion.stages.ingest import SKELETON
from geomotion.stages.rollout import RolloutStageConfig, rollout
from geomotion.stages.scene import modulated, space_of
from geomotion.stages.train import TrainConfig, train
from geomotion.tracking import Artefacts, StageRun

JOINTS = ("waist", "knee", "neck")
MODEL = ModelConfig(
    schema.FlowChart(layers=2, features=8),
    schema.LinearField(skill_dim=1),
    schema.NoRegulariser(),
    0,
    schema.LearnedTimeLaw(),
)
FEW = schema.EvaluationConfig(
    contraction_grid_points=2, region_starts=4, region_steps=20, verify_cells=0, nearby_starts=2,
    joint_returns=schema.JointReturnsConfig(count=4),
)  # fmt: skip


def walking(*left_out: str) -> Demonstrations:
    time_s = np.linspace(0, 2, 40)
    demos = []
    for size in (1.0, 1.1):
        channels = {
            "joints_rad": size * np.stack([np.sin(time_s), np.cos(2 * time_s), 0.1 * time_s], axis=1),
            "position_m": size * np.stack([time_s, 0 * time_s, 0.9 + 0.02 * np.sin(5 * time_s)], axis=1),
            "orientation_wxyz": np.stack([np.cos(0.1 * time_s), 0 * time_s, 0 * time_s, np.sin(0.1 * time_s)], axis=1),
        }
        demos.append(Trajectory(time_s, {name: one for name, one in channels.items() if name not in left_out}))
    names = () if "joints_rad" in left_out else JOINTS
    return preprocess(
        Demonstrations("test/walk", tuple(demos), "R3xS3xjoint", joint_names=names), schema.PreprocessConfig()
    )


def stage_run(folder) -> StageRun:
    folder.mkdir()
    run = StageRun(folder, folder.with_name("checkpoint"), client=None, run_id="1")
    run.log_series = lambda step, values: None
    run.log_policy = lambda *_: None
    return run


def selection(channels=None):
    return schema.DatasetConfig("test/walk", channels, held_out=0)


def trained(root, space, channels=None, demonstrations=None):
    storage.save(walking() if demonstrations is None else demonstrations, root / "ingest")
    ingested = {"ingest": Artefacts("ingest", "0", root / "ingest", "")}
    config = TrainConfig(selection(channels), MODEL, schema.TrajectoryTraining(steps=2, ramp_steps=1), 0, space)
    train(config, ingested, stage_run(root / "train"))
    return ingested | {"train": Artefacts("train", "1", root / "train", "")}


@pytest.fixture(scope="module", params=[schema.PoseSpace.RnxR3xSO3, None], ids=["joints and pose", "joints"])
def artefacts(request, tmp_path_factory):
    return trained(tmp_path_factory.mktemp("walk"), request.param, ["joints_rad"])


@pytest.fixture
def skill(artefacts):
    return models.load(artefacts["train"].path("model.pt"))


def test_states_are_joints_and_then_the_pose(skill):
    dim = 9 if skill.pose else 3
    assert (skill.field.dim, skill.joints) == (dim, 3)
    assert skill.state_channels == (("joints_rad", "pose_m") if skill.pose else ("joints_rad",))
    if skill.pose:
        assert skill.pose.lever_m == 1.0  # a radian of the hip counts as one of a joint


def test_obstacles_are_not_put_among_joints(skill):
    ball = schema.SphereObstacle(centre_m=[0.0, 0.0, 5.0], radius_m=0.1)
    if skill.pose is None:
        assert space_of(ball, skill) == 3
    else:
        assert modulated(schema.NoObstacle(), skill) is None
        with pytest.raises(InvalidSetting, match="begin with joints"):
            modulated(ball, skill)


def test_joints_and_poses_are_judged_apart(artefacts, skill):
    certificate = read_json(artefacts["train"].path("certificate.json"))
    demonstrations = with_pose_vectors(storage.load(artefacts["ingest"].folder), skill.pose)
    found = compute(skill, demonstrations, certificate["rate_per_s"], FEW, schema.SolverConfig()).scores
    assert found["train.joint_rmse"].unit == "deg"
    assert found["returns.claimed.bound_excess"].value < 1e-3
    assert ("train.position_dtwd" in found) == (skill.pose is not None)
    assert ("train.manifold.states_joint_distance" in found) == (skill.pose is not None)


def test_rollouts_have_the_channels_of_the_recording(artefacts, skill, tmp_path):
    config = RolloutStageConfig(schema.RolloutConfig(), schema.SolverConfig(), schema.NoObstacle())
    run = stage_run(tmp_path / "rollout")
    rollout(config, artefacts, run)
    found = storage.load(run.folder / "rollouts")
    recorded = walking()[0]
    shared = ["joints_rad", *(["position_m", "orientation_wxyz"] if skill.pose else [])]
    for name in shared:
        assert found[0].channels[name].shape == recorded.channels[name].shape
        np.testing.assert_allclose(found[0].channels[name][0], recorded.channels[name][0], atol=1e-3)
    assert found[0].channels["joint_velocity_rad_per_s"].shape == (40, 3)


@pytest.mark.parametrize("artefacts", [schema.PoseSpace.RnxR3xSO3], indirect=True)  # others are exported elsewhere
def test_the_exported_policy_says_what_the_field_says(artefacts, tmp_path, without_shape_checks):
    run = stage_run(tmp_path / "export")
    export(ExportConfig(schema.PolicyConfig()), artefacts, run)
    card = read_json(run.folder / "policy.json")
    assert max(card["max_difference_to_torch"].values()) < 1e-3
    assert set(card["goal"]) == {"joints_rad", "position_m", "orientation_wxyz"}
    assert list(card["outputs"])[:3] == ["joint_velocity_rad_per_s", "velocity_m_per_s", "angular_velocity_rad_per_s"]
    assert "obstacle_radius_m" not in card["inputs"]
    assert len(card["example"]["goal"]) == 3
    asked = {name: np.array([row], np.float32) for name, row in card["example"]["inputs"].items()}
    assert OnnxPolicy(run.folder / "policy.onnx")(asked)["joint_velocity_rad_per_s"].shape == (1, 3)


def test_the_body_is_drawn_and_filmed(artefacts, skill, tmp_path):
    unit = np.eye(4)
    above = unit + np.outer([0, 0, 1, 0], [0, 0, 0, 0.8])
    nodes = [("hip", -1, unit), ("waist", 0, unit), ("neck", 1, above), ("knee", 0, 2 * unit - above)]
    skeleton = Skeleton(
        tuple(
            Node(name, parent, tuple(map(tuple, place.tolist())), "revolute", (1.0, 0.0, 0.0))
            for name, parent, place in nodes
        )
    )
    write_json(artefacts["ingest"].folder / SKELETON, {"nodes": skeleton.document()})
    run = stage_run(tmp_path / "body")
    draw_body_motion(schema.BodyConfig(film_fps=2.0, snapshots=2), artefacts, run)
    assert (run.folder / "film.gif").stat().st_size > 0
    drawn = np.load(run.folder / "figures/body.npz")
    hips = drawn["led_0_m"][:, 0]
    recorded = walking()[0].channels["position_m"]
    np.testing.assert_allclose(
        drawn["demonstrated_m"][:, 0], recorded if skill.pose else recorded[:1].repeat(40, 0), atol=1e-5
    )
    assert (np.ptp(hips, axis=0).max() > 0.5) == (skill.pose is not None)


@pytest.mark.parametrize(
    ("space", "channels", "left_out", "error", "message"),
    [
        (schema.PoseSpace.RnxR3xSO3, ["position_m"], (), InvalidSetting, "dataset.state_channels"),
        (schema.PoseSpace.R3xSO3, ["joints_rad"], (), InvalidSetting, "dataset.state_channels"),
        (schema.PoseSpace.RnxR3xSO3, None, ("joints_rad",), DatasetError, "has no joints_rad"),
        (schema.PoseSpace.RnxR3xSO3, None, ("position_m",), DatasetError, "poses need position_m"),
    ],
)
def test_what_does_not_go_together_is_refused(tmp_path, space, channels, left_out, error, message):
    with pytest.raises(error, match=message):
        trained(tmp_path, space, channels, walking(*left_out))
