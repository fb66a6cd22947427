"""Plan and replay of configurations: links, self-collision and limits by the simulator's shapes."""

import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from geomotion import arms
from geomotion import config as schema
from geomotion.demos import readers, storage
from geomotion.demos.preprocessing import preprocess
from geomotion.errors import InvalidSetting
from geomotion.planning.manifold import DecodedPath
from geomotion.planning.plan import Plan, PlanStatus
from geomotion.robot.path_check import Approach, LimitApproach, PathCheck
from geomotion.scores.configurations import ConfigurationPath
from geomotion.stages.graph import GraphStageConfig, graph
from geomotion.stages.path_checks import checked, judge
from geomotion.stages.plan import PlanStageConfig, plan, plan_table
from geomotion.stages.replay import ReplayStageConfig, replay, replay_table
from geomotion.stages.train_manifold import TrainManifoldConfig, train_manifold
from geomotion.tracking import Artefacts, StageRun

S_CURVE = schema.PlanarSCurveDataset(name="planar/s_curve")
METRIC, FRAME = schema.MetricConfig(), schema.EndEffectorFrame.grasp_target
PLANNING = schema.PlanningConfig(samples=30, leave_data_m=0.1, leave_data_rad=1.0)
BESIDE = schema.SphereObstacle(centre_m=[0.0, 0.0, 0.25], radius_m=0.1)


def stage_run(folder) -> StageRun:
    folder.mkdir()
    run = StageRun(folder, folder.parent / f"{folder.name}.checkpoint", client=None, run_id="1")
    run.log_series = lambda step, values: None
    return run


@pytest.fixture(scope="module")
def skill(tmp_path_factory) -> dict[str, Artefacts]:
    """Demonstrations, a manifold of few training steps, and its graph."""
    folder = tmp_path_factory.mktemp("s_curve")
    storage.save(preprocess(readers.read(S_CURVE), S_CURVE.preprocess), folder / "ingest")
    inputs = {"ingest": Artefacts("ingest", "0", folder / "ingest", "")}
    training = schema.ManifoldTraining(steps=100, spread_steps=10, restarts=0)
    manifold = schema.ManifoldConfig(latent_dim=2, points=60, kernels=100)
    fit = TrainManifoldConfig(S_CURVE, manifold, training, 0, None, schema.PlanarArm())
    stages = (
        ("train", train_manifold, fit),
        ("graph", graph, GraphStageConfig(schema.GraphConfig(points_per_axis=30), METRIC)),
    )
    for name, stage, config in stages:
        stage(config, inputs, stage_run(folder / name))
        inputs[name] = Artefacts(name, "0", folder / name, "")
    return inputs


@pytest.fixture
def planned(skill, tmp_path):
    """Plans beside an obstacle; returns the artefacts with the plan, and its document."""
    run = stage_run(tmp_path / "plan")
    plan(PlanStageConfig(PLANNING, METRIC, BESIDE, FRAME), skill, run)
    document = json.loads((run.folder / "plan.json").read_text())
    return skill | {"plan": Artefacts("plan", "0", run.folder, "")}, document


def test_a_plan_is_measured_and_a_replay_comes_with_film_and_numbers(planned, tmp_path):
    inputs, document = planned
    (leg,) = document["legs"]
    assert document["found"], leg["reason"]
    assert document["protected"] == "every link of the arm"
    checks = leg["checks"]
    assert {tuple(one["bodies"]) for one in checks["clearances"]} <= {("upper_arm", "sphere"), ("forearm", "sphere")}
    assert checks["clearances"][0]["distance_m"] >= leg["scores"]["clearance_m"] - 5e-4
    assert checks["self_clearance"] is None and checks["limit"]["margin_rad"] > 0
    assert "joint limits" in plan_table(document)

    run = stage_run(tmp_path / "replay")
    robot = schema.RobotConfig(film_fps=2.0, duration_s=2.0)
    replay(ReplayStageConfig(robot, PLANNING, METRIC, BESIDE), inputs, run)
    done = json.loads((run.folder / "replay.json").read_text())
    assert (done["arm"], done["states"], done["frame"]) == ("planar_2dof", "configurations", "tip")
    assert done["tracking_worst_m"] < 2e-3
    assert set(done["clearance_m"]) == {"upper_arm", "forearm"}
    assert done["self_clearance"] is None and done["limit_margin_rad"] > 0
    assert "kinematics" not in replay_table(done)
    (executed,) = storage.load(run.folder / "trajectory").trajectories
    assert executed.channels["joints_rad"].shape[1] == 2
    with Image.open(run.folder / "film.gif") as film:
        first = np.asarray(film.convert("RGB"), dtype=float)
        film.seek(film.n_frames // 2)
        assert (np.abs(np.asarray(film.convert("RGB"), dtype=float) - first).max(axis=2) > 50).mean() > 0.005


def test_a_moving_obstacle_closes_the_loop_and_is_kept_clear_of(planned, tmp_path):
    inputs, _ = planned
    run = stage_run(tmp_path / "replay")
    robot = schema.RobotConfig(film=False, control_hz=20.0, duration_s=2.0)
    rising = replace(BESIDE, velocity_m_per_s=[0.0, 0.0, 0.02])
    replay(ReplayStageConfig(robot, PLANNING, METRIC, rising), inputs, run)
    done = json.loads((run.folder / "replay.json").read_text())
    assert done["closed_loop"] and done["reached_goal"] and done["unreachable"] == []
    assert min(done["clearance_m"].values()) > 0 and done["contacts"] == {}


def test_what_no_hand_can_hold_is_refused_before_anything_is_executed(skill, tmp_path):
    holding = replace(PLANNING, tool_radius_m=0.02)
    with pytest.raises(InvalidSetting, match=r"planning\.tool_radius_m.*nothing is known of a hand"):
        plan(PlanStageConfig(holding, METRIC, schema.NoObstacle(), FRAME), skill, stage_run(tmp_path / "plan"))


def found(joints_rad) -> Plan:
    """A plan of the Panda that someone took for a path."""
    states = ConfigurationPath(np.atleast_2d(joints_rad), arms.build(schema.PandaArm()).chain.pose)
    progress = np.linspace(0, 1, len(states))
    return Plan(PlanStatus.found, "found", np.zeros((len(states), 2)), DecodedPath(states, progress))


def test_a_path_through_the_arm_itself_is_not_found_and_the_links_are_named():
    folded = np.array([0.0, 0.0, 0.0, -3.0, 0.0, 0.2, 0.0])
    none = Plan(PlanStatus.blocked, "blocked", np.zeros((0, 2)))
    (itself, other), (check, unchecked) = checked([found(folded), none], schema.PandaArm(), PLANNING, [])
    assert itself.status is PlanStatus.self_collision and not itself.found
    assert "panda_hand" in itself.reason and "panda_link1" in itself.reason
    assert check.self_clearances[0].distance_m < 0
    assert other is none and unchecked is None


def measured(clearance_m: float, margin_rad: float = 1.0) -> PathCheck:
    near = Approach(("forearm", "vase"), clearance_m, 3)
    return PathCheck(("vase",), (near,), (), LimitApproach("elbow", margin_rad, 2), 0.2, 10)


def test_links_nearer_than_wanted_and_joints_beyond_limits_are_no_paths():
    wanted = schema.PlanningConfig(clearance_m=0.02)
    free = found(np.zeros(7))
    assert judge(free, measured(0.0199), wanted) is free  # as exactly as the simulator measures
    near = judge(free, measured(0.015), wanted)
    assert near.status is PlanStatus.touches and near.blocking == ("vase",) and "forearm" in near.reason
    soft = replace(wanted, constraint=schema.ConstraintKind.soft)
    assert judge(free, measured(0.015), soft) is free
    assert judge(free, measured(-0.001), soft).status is PlanStatus.touches
    beyond = judge(free, measured(0.5, -0.1), wanted)
    assert beyond.status is PlanStatus.joint_limit and "elbow, by 5.7 deg" in beyond.reason
