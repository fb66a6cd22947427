"""Execution on the simulated arm: what is written, what is said of poses out of reach, and moving obstacles."""

import json
from dataclasses import replace

import numpy as np
import pytest

from geomotion import config as schema
from geomotion.demos import readers, storage
from geomotion.demos.preprocessing import preprocess
from geomotion.errors import InvalidSetting
from geomotion.files import write_json
from geomotion.scores.paths import PosePath
from geomotion.stages.execution import PATIENCE
from geomotion.stages.graph import GraphStageConfig, graph, load_skilled
from geomotion.stages.plan import PlanStageConfig, joined, make_plans
from geomotion.stages.replan import make_pilot
from geomotion.stages.replay import ReplayStageConfig, replay, replay_table
from geomotion.stages.train_manifold import TrainManifoldConfig, train_manifold
from geomotion.tracking import Artefacts, StageRun

REACH = schema.PandaReachDataset(name="panda/reach_to_grasp")
JC = schema.JCDataset(name="letters/jc", demos=3)
METRIC, FILMLESS = schema.MetricConfig(), schema.RobotConfig(film=False, duration_s=2.0)
HAND = ("panda_hand", "panda_leftfinger", "panda_rightfinger")


def stage_run(folder) -> StageRun:
    folder.mkdir()
    run = StageRun(folder, folder.parent / f"{folder.name}.checkpoint", client=None, run_id="1")
    run.log_series = lambda step, values: None
    return run


def trained(dataset, folder, steps: int) -> dict[str, Artefacts]:
    """Demonstrations, a manifold of few training steps, and its graph."""
    storage.save(preprocess(readers.read(dataset), dataset.preprocess), folder / "ingest")
    inputs = {"ingest": Artefacts("ingest", "0", folder / "ingest", "")}
    training = schema.ManifoldTraining(steps=steps, spread_steps=10, restarts=0)
    fit = TrainManifoldConfig(dataset, schema.ManifoldConfig(), training, 0, None, schema.PandaArm())
    stages = (
        ("train", train_manifold, fit),
        ("graph", graph, GraphStageConfig(schema.GraphConfig(points_per_axis=30), METRIC)),
    )
    for name, stage, config in stages:
        stage(config, inputs, stage_run(folder / name))
        inputs[name] = Artefacts(name, "0", folder / name, "")
    return inputs


@pytest.fixture(scope="module")
def skill(tmp_path_factory) -> dict[str, Artefacts]:
    return trained(REACH, tmp_path_factory.mktemp("reach"), 300)


@pytest.fixture
def replayed(skill, tmp_path):
    """Plans and executes; returns the folder of the replay and its document."""

    skilled, demonstrations = load_skilled(skill, METRIC), storage.load(skill["ingest"].folder)

    def execute(robot=FILMLESS, obstacle=None, planning=None, moved_m=(0.0, 0.0, 0.0)):
        planning, obstacle = planning or schema.PlanningConfig(samples=30), obstacle or schema.NoObstacle()
        plans = make_plans(PlanStageConfig(planning, METRIC, obstacle, robot.frame), skilled, demonstrations).plans
        _write_plan(tmp_path / "plan", plans, np.array(moved_m))
        inputs = skill | {"plan": Artefacts("plan", "0", tmp_path / "plan", "")}
        run = stage_run(tmp_path / "replay")
        replay(ReplayStageConfig(robot, planning, METRIC, obstacle), inputs, run)
        return run.folder, json.loads((run.folder / "replay.json").read_text())

    return execute


def _write_plan(folder, plans, moved_m: np.ndarray) -> None:
    """What the plan stage leaves for others, the path ever farther away up to an offset."""
    folder.mkdir()
    found = all(one.found for one in plans)
    write_json(folder / "plan.json", {"found": found, "legs": [one.as_dict() for one in plans]})
    if found:
        path, progress = joined(plans)
        position_m = path.position_m + np.linspace(0, 1, len(path))[:, None] * moved_m
        np.savez(folder / "path.npz", position_m=position_m, orientation=path.orientation, progress=progress)


def test_a_replay_leaves_numbers_a_film_a_trajectory_and_a_picture(replayed):
    folder, document = replayed(replace(FILMLESS, film=True, film_fps=4.0))
    assert document["executed"]
    assert not document["closed_loop"]
    assert document["reached_share"] == 1.0
    assert document["tracking_worst_m"] < 5e-3
    assert document["tracking_worst_rad"] < np.radians(1)
    assert document["limit_margin_rad"] > 0
    executed = storage.load(folder / "trajectory")
    assert executed.trajectories[0].duration_s == pytest.approx(document["duration_s"], abs=0.01)
    assert set(executed.trajectories[0].channels) == {"position_m", "orientation_wxyz", "joints_rad"}
    assert (folder / "film.gif").read_bytes().startswith(b"GIF")
    assert {path.suffix for path in (folder / "figures").iterdir()} >= {".png", ".pdf"}
    assert "tracking error" in replay_table(document)


def test_poses_out_of_reach_are_reported_with_index_and_distance(replayed):
    _, document = replayed(planning=schema.PlanningConfig(samples=12), moved_m=(0.6, 0.0, 0.0))
    unreachable = document["unreachable"]
    assert document["reached_share"] == 1 - len(unreachable) / 12
    assert unreachable[-1]["index"] == 11
    assert 0.01 < unreachable[-1]["position_error_m"] < 0.6
    assert unreachable == sorted(unreachable, key=lambda one: one["index"])
    assert f"pose {unreachable[0]['index']}" in replay_table(document)


def test_without_a_path_nothing_is_executed_and_the_reason_is_given(replayed):
    everywhere = schema.SphereObstacle(centre_m=[0.45, -0.1, 0.25], radius_m=0.15)
    folder, document = replayed(obstacle=everywhere)
    assert not document["executed"]
    assert "sphere" in document["reason"] or "obstacle" in document["reason"]
    assert [path.name for path in folder.iterdir()] == ["replay.json"]
    assert replay_table(document) == f"not executed: {document['reason']}"


def test_poses_in_a_plane_are_refused(tmp_path):
    inputs = trained(JC, tmp_path, 5)
    write_json(tmp_path / "plan.json", {"found": True})
    config = ReplayStageConfig(FILMLESS, schema.PlanningConfig(), METRIC, schema.NoObstacle())
    with pytest.raises(InvalidSetting, match=r"poses in R2 x S2.*expected poses in R3 x S3"):
        replay(config, inputs, stage_run(tmp_path / "replay"))


def test_a_closed_loop_goes_through_every_stop_and_ends_at_the_goal(skill):
    demonstrations, skilled = storage.load(skill["ingest"].folder), load_skilled(skill, METRIC)
    stops_at = [0, 90, 199]
    path = skilled.manifold.data.originals[0]
    stops = PosePath(path.position_m[stops_at], path.orientation[stops_at])
    pilot = make_pilot(schema.RobotConfig(), schema.PlanningConfig(), skilled, demonstrations, stops, [])
    found = [stops.position_m[0]]
    for step in range(900):
        found.append(pilot(step / 60, found[-1], stops.orientation[0])[0])
        if pilot.has_ended():
            break
    assert pilot.reached_goal
    apart_m = np.linalg.norm(np.array(found)[:, None] - stops.position_m, axis=2)
    assert apart_m.min(axis=0).max() < 1e-5
    assert (np.diff(apart_m.argmin(axis=0)) > 0).all()


@pytest.mark.parametrize("seed", [0, 1])
def test_a_sphere_that_crosses_the_way_does_not_touch_the_hand(replayed, skill, seed):
    middle_m = load_skilled(skill, METRIC).manifold.data.originals[0].position_m[100]
    draw = np.random.default_rng(seed)
    velocity = draw.normal(size=3) * [1, 0.2, 1]
    velocity *= 0.1 / np.linalg.norm(velocity)
    velocity[2] = abs(velocity[2])
    crossing = schema.SphereObstacle(
        centre_m=(middle_m - 2.0 * velocity).tolist(), radius_m=0.04, velocity_m_per_s=velocity.tolist()
    )
    robot = schema.RobotConfig(film=False, control_hz=30.0)
    _, document = replayed(robot, crossing, schema.PlanningConfig(leave_data_m=0.02, leave_data_rad=0.06))
    assert document["closed_loop"]
    assert document["replans"] > 1
    assert document["replan_median_ms"] > 0
    assert not set(document["contacts"].get("sphere", ())) & set(HAND)
    assert min(document["clearance_m"][link] for link in HAND) > 0
    assert document["reached_goal"]
    assert document["duration_s"] < 0.8 * PATIENCE * 4.0  # about 4 s without waiting; soon after the goal it ends
    assert "goal" in replay_table(document)
