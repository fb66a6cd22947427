"""A learned policy on the simulated Panda: what is written, what is refused, and what disturbs it."""

import json
from dataclasses import replace

import numpy as np
import pytest

from geomotion import config as schema
from geomotion import models
from geomotion.demos import storage
from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.demos.pose_vectors import POSE_CHANNEL, fit_pose_coordinates, with_pose_vectors
from geomotion.demos.preprocessing import preprocess
from geomotion.errors import InvalidSetting
from geomotion.files import write_json
from geomotion.models import ModelConfig, Skill
from geomotion.robot import panda
from geomotion.robot.chain import panda_chain
from geomotion.stages.policy_replay import PolicyReplayConfig, policy_replay_table, replay_policy
from geomotion.tracking import Artefacts, StageRun
from geomotion.training.data import Geometry, TrainingSet

DURATION_S, RATE_PER_S = 1.2, 0.9
UNTRAINED = ModelConfig(
    schema.IdentityChart(),
    schema.LinearField(min_rate_per_duration=0.5, initial_rate_per_duration=RATE_PER_S * DURATION_S),
    schema.NoRegulariser(),
    seed=0,
)
QUIET = schema.ReplayConfig(film=False, pushes=[], duration_s=0.3, control_hz=30.0)


def demonstrations(shift_m: float | np.ndarray = 0.0) -> Demonstrations:
    """From home to the side, with a turn about the vertical; joints and poses of the same motions."""
    ways = np.linspace(0, 1, 40)[:, None]
    found = []
    for turn in (0.0, 0.05):
        joints = panda.HOME_RAD + ways * np.array([0.5 + turn, 0.2, 0.0, 0.1, turn, 0.0, 0.3])
        position, orientation = panda_chain("grasp_target").pose(joints)
        channels = {
            "position_m": position + shift_m,
            "orientation_wxyz": orientation,
            "joints_rad": joints,
        }
        found.append(Trajectory(np.linspace(0, DURATION_S, 40), channels, "sideways"))
    shown = Demonstrations("tiny", tuple(found), "R3xS3", "panda_link0", "the test", "MIT")
    return preprocess(shown, schema.PreprocessConfig())


def learned(folder, kind: str, shift_m: float | np.ndarray) -> dict[str, Artefacts]:
    """What the stages before leave, with a field that leads straight to the goal."""
    shown = demonstrations(shift_m)
    storage.save(shown, folder / "ingest")
    coordinates = fit_pose_coordinates(shown, "SO3", "radial", None) if kind == POSE_CHANNEL else None
    channels = tuple(kind.split("+"))
    data = TrainingSet.from_demonstrations(with_pose_vectors(shown, coordinates), channels)
    geometry = Geometry.of(data)
    (folder / "train").mkdir()
    skill = Skill(models.build(UNTRAINED, geometry), UNTRAINED, geometry, channels, (0,), (1,), coordinates)
    models.save(folder / "train/model.pt", skill)
    write_json(folder / "train/certificate.json", {"rate_per_s": RATE_PER_S})
    return {name: Artefacts(name, "0", folder / name, "") for name in ("ingest", "train")}


@pytest.fixture
def replayed(tmp_path):
    def execute(kind=POSE_CHANNEL, replay=QUIET, obstacle=None, shift_m=0.0):
        (tmp_path / "replay").mkdir()
        run = StageRun(tmp_path / "replay", tmp_path / "checkpoint", client=None, run_id="1")
        config = PolicyReplayConfig(replay, obstacle or schema.NoObstacle())
        replay_policy(config, learned(tmp_path, kind, shift_m), run)
        return run.folder, json.loads((run.folder / "replay.json").read_text())

    return execute


def test_a_pushed_policy_leaves_scores_a_film_a_trajectory_and_a_picture(replayed):
    push = schema.PushConfig(time_s=0.2, duration_s=0.25, force_n=[0.0, 0.0, 20.0])
    folder, document = replayed(replay=replace(QUIET, pushes=[push], film=True, film_fps=2.0, duration_s=1.3))
    assert document["executed"]
    (found,) = document["pushes"]
    assert 0.035 < found["pushed_m"] < 0.05
    assert found["back_s"]["25"] == pytest.approx(np.log(found["pushed_m"] / 0.025) / RATE_PER_S, rel=0.25)
    assert document["peak_speed_ratio"] == pytest.approx(1.0, abs=0.3)
    assert 0 < document["largest_torque_share"] < 1
    assert document["energy_j"] > 0
    assert document["limit_margin_rad"] > 0
    assert document["end_error_m"] < 0.1
    assert storage.load(folder / "trajectory").trajectories[0].duration_s == pytest.approx(1.3, abs=0.01)
    assert (folder / "film.gif").read_bytes().startswith(b"GIF")
    assert {path.suffix for path in (folder / "figures").iterdir()} == {".png", ".pdf", ".npz"}
    assert "push at 0.20 s" in policy_replay_table(document)


@pytest.mark.parametrize("kind", ["position_m", "joints_rad"])
def test_positions_and_joints_are_led_too(replayed, kind):
    _, document = replayed(kind)
    assert document["largest_deviation_m"] < 5e-3
    assert (document["end_error_m"] is None) == (kind == "joints_rad")
    assert (document["end_error_rad"] is None) == (kind == "position_m")


def test_the_goal_may_move_and_obstacles_are_gone_around(replayed):
    middle = demonstrations()[0].channels["position_m"][15]
    ball = schema.SphereObstacle(centre_m=(middle - [0.0, 0.0, 0.1]).tolist(), radius_m=0.02)
    change = schema.GoalChangeConfig(time_s=0.2, shift_m=[0.0, 0.0, -0.2])
    _, document = replayed(replay=replace(QUIET, goal_changes=[change], clearance_m=0.05), obstacle=ball)
    assert document["largest_deviation_m"] < 8e-3
    assert document["end_error_m"] > 0.1  # of the goal that moved
    assert document["clearance_m"]["panda_hand"] <= 0.1
    assert "smallest clearance" in policy_replay_table(document)


def test_without_pushes_of_its_own_a_motion_is_pushed_aside_by_5_cm(replayed):
    _, document = replayed(replay=replace(QUIET, pushes=None, duration_s=0.8))
    (found,) = document["pushes"]
    assert found["time_s"] == pytest.approx(0.4 * DURATION_S)
    assert 0.03 < found["pushed_m"] < 0.055


def test_a_start_inside_the_arm_itself_is_said(replayed):
    """As of handwriting, which lies around the origin: the arm's base stands there."""
    home_m = panda_chain("grasp_target").pose(panda.HOME_RAD)[0]
    folder, document = replayed(shift_m=np.array([0.1, 0.0, 0.0]) - home_m)
    assert not document["executed"] and "hit itself at the start" in document["reason"]
    assert [path.name for path in folder.iterdir()] == ["replay.json"]


def test_a_start_out_of_reach_is_said(replayed):
    folder, document = replayed(shift_m=1.5)
    assert not document["executed"]
    assert "cannot take the start" in policy_replay_table(document)
    assert [path.name for path in folder.iterdir()] == ["replay.json"]


@pytest.mark.parametrize(
    ("kind", "replay", "expected"),
    [
        (POSE_CHANNEL, replace(QUIET, start="demo:7"), "demo:0 to demo:1"),
        (POSE_CHANNEL, replace(QUIET, start=[0.5, 0.0]), "6 coordinates"),
        ("position_m+joints_rad", QUIET, "positions in space"),
        (
            "joints_rad",
            replace(QUIET, goal_changes=[schema.GoalChangeConfig(time_s=0.1, shift_m=[0.0, 0.0, 0.1])]),
            "lie in space",
        ),
        (
            "joints_rad",
            replace(QUIET, pushes=[schema.PushConfig(time_s=100.0, force_n=[1.0, 0.0, 0.0])]),
            "of the motion",
        ),
    ],
)
def test_what_does_not_fit_is_refused(replayed, kind, replay, expected):
    with pytest.raises(InvalidSetting, match=expected):
        replayed(kind, replay)


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"pushes": [{"time_s": 1.0}]}, "one of them"),
        ({"pushes": [{"time_s": 1.0, "force_n": [1.0, 2.0]}]}, r"replay\.pushes\.force_n=.* three finite numbers"),
        ({"goal_changes": [{"time_s": 2.0, "shift_m": [0.0, 0.0, 0.1]}] * 2}, "times in order"),
        ({"noise_m": -0.1}, "0 or more"),
    ],
)
def test_impossible_disturbances_are_refused(settings, expected):
    with pytest.raises(InvalidSetting, match=expected):
        kinds = {"pushes": schema.PushConfig, "goal_changes": schema.GoalChangeConfig}
        schema.ReplayConfig(
            **{key: [kinds[key](**one) for one in value] if key in kinds else value for key, value in settings.items()}
        )
