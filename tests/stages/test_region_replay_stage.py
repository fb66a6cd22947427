"""A policy in its safety region on the simulated Panda: pushed out of it, it comes back, and that is said."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from geomotion import config as schema
from geomotion import models
from geomotion.demos import storage
from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.errors import InvalidSetting
from geomotion.files import read_json, write_json
from geomotion.models import ModelConfig, Skill
from geomotion.stages.policy_replay import PolicyReplayConfig, policy_replay_table, replay_policy
from geomotion.tracking import Artefacts, StageRun
from geomotion.training.data import Geometry

GOAL = np.array([0.45, 0.0, 0.4])
SAFETY = schema.RiemannianSafety(points_per_axis=40)
BALL = schema.SphereObstacle(centre_m=[0.5, 0.002, 0.4], radius_m=0.006)
QUIET = schema.ReplayConfig(film=False, pushes=[], duration_s=0.5, control_hz=30.0, start="demo:1")


@pytest.fixture
def inputs(tmp_path: Path) -> dict[str, Artefacts]:
    """A skill of two dimensions in space that runs straight to the goal."""
    time_s = np.linspace(0, 1, 60)
    demos = []
    for height in (0.02, 0.0, -0.02):
        velocity = np.tile([-0.1, -height, 0.0], (60, 1))
        states = GOAL + np.outer(1 - time_s, [0.1, height, 0.0])
        demos.append(Trajectory(time_s, {"position_m": states, "velocity_m_per_s": velocity}))
    storage.save(Demonstrations("test/straight", tuple(demos), "R3"), tmp_path / "ingest")
    field = schema.LinearField(2, 10.0, min_rate_per_duration=0.1, initial_rate_per_duration=2.0)
    config = ModelConfig(schema.IdentityChart(), field, schema.NoRegulariser(), seed=0)
    goal = tuple(GOAL.tolist())
    geometry = Geometry((0.5, 0.0, 0.4), 0.05, (0.5, 0.0, 0.4), goal, duration_s=1.0)
    skill = Skill(models.build(config, geometry).eval(), config, geometry, ("position_m",), (0, 1, 2), ())
    models.save(tmp_path / "train" / "model.pt", skill)
    write_json(tmp_path / "train/certificate.json", {"rate_per_s": 1.0})
    return {name: Artefacts(name, "0", tmp_path / name, "") for name in ("ingest", "train")}


@pytest.fixture
def replayed(inputs, tmp_path):
    def execute(replay):
        (tmp_path / "replay").mkdir()
        run = StageRun(tmp_path / "replay", tmp_path / "checkpoint", client=None, run_id="1")
        replay_policy(PolicyReplayConfig(replay, BALL, SAFETY), inputs, run)
        return run.folder, read_json(run.folder / "replay.json")

    return execute


def test_thrown_over_the_border_the_arm_is_steered_back_and_around_the_obstacle(replayed):
    thrown = schema.PushConfig(time_s=0.1, displacement_m=[0.0, 0.07, 0.0])
    folder, document = replayed(replace(QUIET, pushes=[thrown], duration_s=1.5))
    found, free = document["safety"], document["safety"]["without_region"]
    (excursion,) = found["excursions"]
    assert 0.1 <= excursion["left_s"] < 0.2
    assert excursion["back_after_s"] < 0.5
    assert found["border_m"] < -0.01
    assert 0.5 < found["inside_share"] < 1
    assert found["has_way_to_goal"]
    assert free["excursions"]
    assert document["end_error_m"] < 0.01
    assert (folder / "figures/closed_loop_region.png").is_file()
    assert "back after" in policy_replay_table(document)


def test_undisturbed_it_stays_in_the_region_and_clear_of_the_obstacle_into_which_the_field_alone_leads(replayed):
    _, document = replayed(replace(QUIET, duration_s=1.0))
    found, free = document["safety"], document["safety"]["without_region"]
    assert found["inside_share"] == found["support_share"] == 1
    assert not found["excursions"]
    assert found["tip_clearance_m"] > 0 > free["tip_clearance_m"]
    assert found["border_m"] > 0 > free["border_m"]


def test_the_goal_cannot_leave_the_region(replayed):
    change = schema.GoalChangeConfig(time_s=0.1, shift_m=[0.0, 0.0, 0.1])
    with pytest.raises(InvalidSetting, match="around the demonstrations"):
        replayed(replace(QUIET, goal_changes=[change]))
