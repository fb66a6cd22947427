"""The rollout stage with obstacles: what it follows, writes and refuses."""

from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_module
from omegaconf import OmegaConf

from geomotion import config as schema
from geomotion import models
from geomotion.demos import storage
from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.errors import InvalidSetting, UnknownName
from geomotion.files import read_json
from geomotion.models import ModelConfig, Skill
from geomotion.stages.commands import run_verb
from geomotion.stages.rollout import RolloutStageConfig, rollout, rollout_table
from geomotion.tracking import Artefacts, StageRun
from geomotion.training.data import Geometry

GOAL = (0.0, 0.0)
STARTS = schema.RolloutConfig(starts_m=[[0.1, 0.01], [0.1, -0.02]], duration_s=4.0, points=200)
IN_THE_WAY = schema.SphereObstacle(centre_m=[0.05, 0.0], radius_m=0.015)


@pytest.fixture
def inputs(tmp_path: Path) -> dict[str, Artefacts]:
    """A field that runs straight to the goal, as if learned from two straight demonstrations."""
    slow = schema.LinearField(min_rate_per_duration=0.1, initial_rate_per_duration=2.0)
    config = ModelConfig(schema.IdentityChart(), slow, schema.NoRegulariser(), seed=0)
    geometry = Geometry(centre=(0.05, 0.0), scale_m=0.05, mean=(0.05, 0.0), goal=GOAL, duration_s=1.0)
    skill = Skill(models.build(config, geometry).eval(), config, geometry, ("position_m",), (0, 1), ())
    time_s = np.linspace(0, 1, 30)
    demos = []
    for height in (0.01, -0.01):
        states = np.outer(1 - time_s, [0.1, height])
        velocity = np.tile([-0.1, -height], (30, 1))
        demos.append(Trajectory(time_s, {"position_m": states, "velocity_m_per_s": velocity}))
    storage.save(Demonstrations("test/straight", tuple(demos), "R2"), tmp_path / "ingest")
    models.save(tmp_path / "train" / "model.pt", skill)
    return {name: Artefacts(name, "0", tmp_path / name, "") for name in ("ingest", "train")}


@pytest.fixture
def run(tmp_path: Path) -> StageRun:
    (tmp_path / "rollout").mkdir()
    return StageRun(tmp_path / "rollout", tmp_path / "checkpoint", client=None, run_id="1")


def stage_config(obstacle: schema.ObstacleConfig) -> RolloutStageConfig:
    return RolloutStageConfig(STARTS, schema.SolverConfig(), obstacle)


@pytest.mark.parametrize(
    "obstacle",
    [
        IN_THE_WAY,
        schema.EllipsoidObstacle(centre_m=[0.05, 0.0], semi_axes_m=[0.01, 0.02], rotation_rad=[0.4]),
        schema.BoxObstacle(centre_m=[0.05, 0.0], sides_m=[0.02, 0.03]),
        schema.SphereObstacle(centre_m=[0.05, 0.1], radius_m=0.02, velocity_m_per_s=[0.0, -0.1]),
        schema.SeveralObstacles(
            bodies=[
                {"shape": "sphere", "centre_m": [0.07, 0.01], "radius_m": 0.01},
                {"shape": "box", "centre_m": [0.035, -0.01], "sides_m": [0.02, 0.02]},
            ]
        ),
        schema.PolygonObstacle(
            centre_m=[0.05, 0.0],
            vertices_m=[[-0.02, -0.02], [0.02, -0.02], [0.02, 0.02], [0.0, -0.01]],
            rotation_rad=[0.2],
        ),
    ],
    ids=["sphere", "ellipsoid", "box", "moving", "several", "polygon"],
)
def test_rollouts_go_around_obstacles_to_the_goal(inputs, run, obstacle):
    rollout(stage_config(obstacle), inputs, run)
    document = read_json(run.folder / "rollouts.json")
    for row in document["rollouts"]:
        assert row["reached_goal"]
        assert row["method"] == "dopri5"
        assert -1e-9 < row["clearance_m"] < 0.05
    assert "clearance" in rollout_table(document)
    with np.load(run.folder / "figures" / "rollouts.npz", allow_pickle=False) as arrays:
        assert {"demo_1", "rollout_1", "obstacle_0", "obstacle_at_end_0", "goals"} <= set(arrays.files)
    for suffix in ("png", "pdf"):
        assert (run.folder / "figures" / f"rollouts.{suffix}").stat().st_size > 1000
    velocities = storage.load(run.folder / "rollouts")[0].channels["velocity_m_per_s"]
    states = storage.load(run.folder / "rollouts")[0].channels["position_m"]
    between = (velocities[1:] + velocities[:-1]) / 2  # obstacles bend paths sharply, at few points
    assert np.abs(np.diff(states, axis=0) * 199 / 4 - between).mean() < 0.005


def test_corners_are_further_starts_and_drawn_apart(inputs, run):
    config = RolloutStageConfig(
        schema.RolloutConfig(points=20, corners=True), schema.SolverConfig(), schema.NoObstacle()
    )
    rollout(config, inputs, run)
    rows = read_json(run.folder / "rollouts.json")["rollouts"]
    assert [row["start"] for row in rows] == ["demonstration 0", "demonstration 1", *(f"corner {n}" for n in range(4))]
    with np.load(run.folder / "figures" / "rollouts.npz", allow_pickle=False) as arrays:
        assert {"rollout_1", "corner_rollout_3", "field_velocity"} <= set(arrays.files)
        np.testing.assert_allclose(arrays["corner_rollout_0"][0], [-0.02, -0.014])


def test_starts_far_from_what_was_demonstrated_are_named(inputs, run, caplog):
    starts = schema.RolloutConfig(starts_m=[[0.1, 0.01], [0.1, 2.0]], points=20)
    rollout(RolloutStageConfig(starts, schema.SolverConfig(), schema.NoObstacle()), inputs, run)
    (warning,) = [record.getMessage() for record in caplog.records if record.levelname == "WARNING"]
    assert "start 1 is far outside: coordinate 1 is" in warning


def test_free_space_keeps_the_closed_form_and_has_no_clearance(inputs, run):
    rollout(stage_config(schema.NoObstacle()), inputs, run)
    document = read_json(run.folder / "rollouts.json")
    assert {(row["method"], row["clearance_m"]) for row in document["rollouts"]} == {("closed_form", None)}
    assert "clearance" not in rollout_table(document)


U_SHAPE = [[0, 0], [3, 0], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]]
MISFITS = {
    "convex_hull=true": schema.PolygonObstacle(
        centre_m=[0.05, 0.0], vertices_m=[[0.01 * x, 0.01 * y] for x, y in U_SHAPE]
    ),
    "apart from each other": schema.SeveralObstacles(
        bodies=[{"shape": "sphere", "centre_m": [0.05 + 0.01 * n, 0.0], "radius_m": 0.01} for n in range(2)]
    ),
    "it has 3 coordinates, the state 2": schema.MeshObstacle(centre_m=[0.0, 0.0, 0.0], file="duck.obj"),
    "2 numbers": schema.SphereObstacle(centre_m=[0.0, 0.1, 0.2], radius_m=0.01),
    "leaves the goal free": schema.SphereObstacle(centre_m=[0.0, 0.005], radius_m=0.01),
    "one angle": schema.BoxObstacle(centre_m=[0.05, 0.0], sides_m=[0.01, 0.01], rotation_rad=[0.1, 0.2]),
}


@pytest.mark.parametrize("expected", MISFITS)
def test_obstacles_that_do_not_fit_are_refused(inputs, run, expected):
    with pytest.raises(InvalidSetting, match=expected):
        rollout(stage_config(MISFITS[expected]), inputs, run)
    assert not list(run.folder.iterdir())


def test_bodies_are_checked_like_single_obstacles():
    with pytest.raises(UnknownName, match="sphere"):
        schema.SeveralObstacles(bodies=[{"shape": "spere", "centre_m": [0, 0], "radius_m": 1}])
    for body in ({"shape": "sphere", "centre_m": [0, 0]}, {"shape": "sphere", "centre_m": [0], "sides_m": [1]}, {}):
        with pytest.raises(InvalidSetting, match=r"obstacle\.bodies"):
            schema.SeveralObstacles(bodies=[body])
    with pytest.raises(InvalidSetting, match="radius_m"):
        schema.SeveralObstacles(bodies=[{"shape": "sphere", "centre_m": [0, 0], "radius_m": -1}])


def test_a_rollout_at_the_model_s_precision_stays_outside(inputs, run):
    rollout(stage_config(IN_THE_WAY), inputs, run)
    paths = storage.load(run.folder / "rollouts").trajectories
    gaps = [np.linalg.norm(path.channels["position_m"] - [0.05, 0.0], axis=1).min() - 0.015 for path in paths]
    assert min(gaps) > -1e-6


def test_the_verb_takes_an_obstacle_beside_a_trained_run(fresh_store):
    toy = ["training.steps=2", "dataset.demos=3", "dataset.points=30", "chart.layers=2", "chart.features=6"]
    around = ["run=latest", "rollout.demos=[0]", "obstacle=sphere", "obstacle.centre_m=[1,1]", "obstacle.radius_m=0.5"]
    with initialize_config_module(version_base="1.3", config_module="geomotion.conf"):
        for verb, overrides in (("train", toy), ("rollout", around)):
            typed = [*overrides, f"tracking.root={fresh_store}"]
            result = run_verb(verb, OmegaConf.to_object(compose("ncds", overrides=typed)), typed)
    (row,) = result.document["rollouts"]["rollouts"]
    assert row["method"] == "dopri5"
    assert 0.1 < row["clearance_m"] < 1.5
    assert "clearance" in result.text


def test_a_rollout_that_becomes_infinite_is_kept_as_far_as_it_is_finite(inputs, run):
    starts = schema.RolloutConfig(starts_m=[[0.1, 0.01]], duration_s=1e6, points=200)
    coarse = schema.SolverConfig(method=schema.SolverMethod.rk4)
    rollout(RolloutStageConfig(starts, coarse, schema.NoObstacle()), inputs, run)
    (kept,) = storage.load(run.folder / "rollouts").trajectories
    assert 2 <= len(kept) < 200
    document = read_json(run.folder / "rollouts.json")
    (row,) = document["rollouts"]
    assert (row["status"], row["distance_to_goal_m"]) == ("diverged", None)
    assert "infinite" in rollout_table(document)
