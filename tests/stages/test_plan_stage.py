"""Planning as a stage, on a trained manifold: obstacles on the way, where start and goal are, what is written."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from geomotion import config as schema
from geomotion.demos import readers, storage
from geomotion.demos.preprocessing import preprocess
from geomotion.errors import DatasetError, InvalidSetting, MissingData
from geomotion.obstacles.motion import ConstantVelocity, MovingBody
from geomotion.obstacles.solids import Sphere
from geomotion.planning.ends import Query
from geomotion.planning.plan import Plan, PlanStatus
from geomotion.planning.planner import Planner
from geomotion.robot.panda_arm import panda_arm
from geomotion.robot.scene import ArmScene
from geomotion.stages import planners
from geomotion.stages.graph import GraphStageConfig, graph, load_skilled
from geomotion.stages.plan import PlanStageConfig, make_plans, plan, plan_leg
from geomotion.stages.scene import moving_bodies
from geomotion.stages.train_manifold import TrainManifoldConfig, train_manifold
from geomotion.tracking import Artefacts, StageRun

pytestmark = pytest.mark.slow

REACH = schema.PandaReachDataset(name="panda/reach_to_grasp", points=60)
MANIFOLD = schema.ManifoldConfig(kernels=150, points=60)
TRAINING = schema.ManifoldTraining(steps=800, spread_steps=150, restarts=0)
METRIC = schema.MetricConfig()
FRAME = schema.EndEffectorFrame.grasp_target
FREE = schema.NoObstacle()
CLEARANCE_M, PYBULLET_EXACT_M = 0.01, 5e-4
LEAVE_M = 0.03


def run_in(folder: Path) -> StageRun:
    folder.mkdir(parents=True)
    run = StageRun(folder, folder / "checkpoint", client=None, run_id="0")
    run.log_series = lambda step, values: None
    return run


@pytest.fixture(scope="module")
def inputs(tmp_path_factory) -> dict[str, Artefacts]:
    """Artefacts of ingest, train and graph."""
    root = tmp_path_factory.mktemp("reach")
    storage.save(preprocess(readers.read(REACH), REACH.preprocess), root / "ingest")
    found = {"ingest": Artefacts("ingest", "0", root / "ingest", "")}
    selection = schema.DatasetConfig(REACH.name)
    training = TrainManifoldConfig(selection, MANIFOLD, TRAINING, 0, None, schema.PandaArm())
    train_manifold(training, found, run_in(root / "train"))
    found["train"] = Artefacts("train", "0", root / "train", "")
    graph(GraphStageConfig(schema.GraphConfig(points_per_axis=60), METRIC), found, run_in(root / "graph"))
    return found | {"graph": Artefacts("graph", "0", root / "graph", "")}


@pytest.fixture(scope="module")
def planned(inputs):
    """``planned(obstacle, start="demo:0")`` answers with the plans of all legs."""
    skilled, demonstrations = load_skilled(inputs, METRIC), storage.load(inputs["ingest"].folder)

    def answer(obstacle=FREE, **planning):
        config = PlanStageConfig(schema.PlanningConfig(**planning), METRIC, obstacle, FRAME)
        return make_plans(config, skilled, demonstrations)

    return answer


@pytest.fixture(scope="module")
def free_m(planned) -> np.ndarray:
    """Positions of the geodesic in free space."""
    (found,) = planned().plans
    assert found.found
    return found.path.states.position_m


@pytest.fixture(scope="module")
def middle_m(free_m) -> np.ndarray:
    """Where obstacles stand in the way."""
    return free_m[100]


def sphere(centre_m, radius_m, **changes) -> schema.SphereObstacle:
    return schema.SphereObstacle(centre_m=[float(value) for value in centre_m], radius_m=radius_m, **changes)


def duck(centre_m, scale: float) -> schema.MeshObstacle:
    """The duck of pybullet_data, upright, its middle at some place."""
    import pybullet_data
    import trimesh

    path = Path(pybullet_data.getDataPath()) / "duck.obj"
    middle = trimesh.load(path, process=False, force="mesh").bounds.mean(axis=0)
    turn = [np.pi / 2, 0.0, 0.0]
    origin = centre_m - Rotation.from_rotvec(turn).apply(scale * middle)
    return schema.MeshObstacle(centre_m=origin.tolist(), file=str(path), scale=scale, rotation_rad=turn)


def cloud(centre_m, radius_m: float, folder: Path) -> schema.PointCloudObstacle:
    """5000 points on a ball."""
    points = np.random.default_rng(0).normal(size=(5000, 3))
    np.save(folder / "ball.npy", radius_m * points / np.linalg.norm(points, axis=1, keepdims=True))
    return schema.PointCloudObstacle(centre_m=centre_m.tolist(), file=str(folder / "ball.npy"), radius_m=0.003)


SMALL = {
    "sphere": lambda place, folder: sphere(place, 0.03),
    "mesh": lambda place, folder: duck(place, 0.02),
    "point cloud": lambda place, folder: cloud(place, 0.015, folder),
}
LARGE = {
    "sphere": lambda place, folder: sphere(place, 0.15),
    "mesh": lambda place, folder: duck(place, 0.25),
    "point cloud": lambda place, folder: cloud(place, 0.15, folder),
}


class TestObstaclesOnTheWay:
    @pytest.mark.parametrize("kind", SMALL)
    def test_the_decoded_path_keeps_its_clearance_by_pybullets_own_distances(
        self, kind, planned, free_m, middle_m, tmp_path
    ):
        obstacle = SMALL[kind](middle_m, tmp_path)
        (found,) = planned(obstacle, leave_data_m=LEAVE_M, clearance_m=CLEARANCE_M).plans
        assert found.found, found.reason
        assert found.scores.clearance_m >= CLEARANCE_M
        (body,) = moving_bodies(obstacle, 3)
        with ArmScene(panda_arm()) as scene:
            scene.add_obstacle(body.name, body.body, body.motion.offset(0.0))
            before, apart = (
                [scene.probe_distance(point, body.name) for point in points]
                for points in (free_m, found.path.states.position_m)
            )
        assert min(before) < CLEARANCE_M / 2  # the obstacle stood in the way
        assert min(apart) >= CLEARANCE_M - PYBULLET_EXACT_M

    @pytest.mark.parametrize("kind", LARGE)
    def test_without_a_detour_the_obstacle_is_named(self, kind, planned, middle_m, tmp_path):
        (found,) = planned(LARGE[kind](middle_m, tmp_path)).plans
        assert found.status in (PlanStatus.blocked, PlanStatus.goal_covered, PlanStatus.start_covered)
        assert found.blocking == (kind,)
        assert kind in found.reason
        assert not found.found

    @pytest.mark.parametrize(("key", "end"), [("start_covered", 0), ("goal_covered", -1)])
    def test_one_that_covers_an_end_is_named(self, planned, key, end):
        (free,) = planned().plans
        (found,) = planned(sphere(free.path.states.position_m[end], 0.02)).plans
        assert found.status is PlanStatus[key]
        assert found.blocking == ("sphere",)

    def test_of_several_only_the_one_in_the_way_is_named(self, planned, middle_m):
        bodies = [sphere([0.5, 0.6, 0.6], 0.02), sphere(middle_m, 0.15)]
        (found,) = planned(schema.SeveralObstacles(bodies=bodies)).plans
        assert found.blocking == ("sphere 1",)

    def test_a_moving_one_counts_where_it_is_at_the_beginning(self, planned, middle_m):
        aside = [float(value) for value in middle_m + np.array([0.0, 0.0, 0.5])]
        path = {"path_m": [aside, middle_m.tolist()], "path_times_s": [0.0, 2.0]}
        (found,) = planned(sphere(aside, 0.15, **path)).plans
        assert found.found
        (met,) = planned(sphere(aside, 0.15, path_m=path["path_m"][::-1], path_times_s=[0.0, 2.0])).plans
        assert met.blocking == ("sphere",)


class KnowsAWayRound(Planner):
    """Has to cross a region without data where the wall stands."""

    def __init__(self):
        pass

    def plan(self, query, bodies=()):
        status = PlanStatus.crosses if "wall" in planners.names(list(bodies)) else PlanStatus.found
        return Plan(status, status.value, np.zeros((0, 2)))


class TestAWayWithoutData:
    def bodies(self, *names):
        return [MovingBody(name, Sphere(torch.zeros(3), 0.1), ConstantVelocity(np.zeros(3))) for name in names]

    def test_obstacles_that_leave_only_that_block_and_are_named(self):
        found = plan_leg(KnowsAWayRound(), object.__new__(Query), self.bodies("vase", "wall"))
        assert found.status is PlanStatus.blocked
        assert found.blocking == ("wall",)
        assert "wall" in found.reason and PlanStatus.crosses.value in found.reason

    def test_obstacles_aside_do_not(self):
        assert plan_leg(KnowsAWayRound(), object.__new__(Query), self.bodies("vase")).found


class TestPlaces:
    @pytest.mark.parametrize(
        ("start", "words"),
        [
            ("demo:99", "demo:0 to demo:8"),
            ("demo:-1", "demo:0 to demo:8"),
            ("latent:99:0", "inside the latent grid"),
            ("latent:0", "inside the latent grid"),
            ("latent:a:0", "numbers between the colons"),
            ("antipode:0", "antipodal=doubled"),
            ("home", "demo:N, latent:A:B, or a pose"),
            (3, "demo:N, latent:A:B, or a pose"),
            ([0.4, 0.0, 0.3], "7 numbers"),
            ([0.4, 0.0, 0.3, 0.0, 1.0, 0.0, "x"], "7 numbers"),
            ([0.4, 0.0, 0.3, 2.0, 0.0, 0.0, 0.0], "its length is 2"),
        ],
    )
    def test_those_that_make_no_sense_are_refused(self, planned, start, words):
        with pytest.raises(InvalidSetting, match=words) as caught:
            planned(start=start)
        assert caught.value.key == "planning.start"

    @pytest.mark.parametrize(("key", "status"), [("start", "start_outside"), ("goal", "goal_outside")])
    def test_a_pose_far_away_is_an_answer(self, planned, key, status):
        (found,) = planned(**{key: [1.5, 0.0, 0.3, 0.0, 1.0, 0.0, 0.0]}).plans
        assert found.status is PlanStatus[status]
        assert "planning.leave_data_m=" in found.reason

    def test_via_points_make_legs_that_meet(self, planned):
        found = planned(start="demo:0", via=["demo:1"], goal="demo:2").plans
        assert [one.found for one in found] == [True, True]
        first, second = (one.path.states for one in found)
        np.testing.assert_allclose(first.position_m[-1], second.position_m[0], atol=1e-9)

    def test_ends_are_those_that_were_asked_for(self, planned, inputs):
        wanted = storage.load(inputs["ingest"].folder)[2].channels["position_m"]
        (found,) = planned(start="demo:2", goal="demo:2").plans
        np.testing.assert_allclose(found.path.states.position_m[[0, -1]], wanted[[0, -1]], atol=1e-9)


BROKEN_OBSTACLES = {
    "a centre of two numbers": (schema.SphereObstacle(centre_m=[0.5, 0.0], radius_m=0.1), "3 numbers"),
    "words for places": (
        sphere([0.5, 0, 0], 0.1, path_m=[["a", 0, 0], [0, 0, 0]], path_times_s=[0.0, 1.0]), "obstacle.path_m",
    ),
    "numbers for places": (sphere([0.5, 0, 0], 0.1, path_m=[1, 2], path_times_s=[0.0, 1.0]), "obstacle.path_m"),
    "times that go back": (
        sphere([0.5, 0, 0], 0.1, path_m=[[0, 0, 0], [1, 0, 0]], path_times_s=[1.0, 0.0]), "times that increase",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", BROKEN_OBSTACLES)
def test_obstacles_that_make_no_sense_are_refused(planned, what):
    obstacle, words = BROKEN_OBSTACLES[what]
    with pytest.raises(InvalidSetting, match=words):
        planned(obstacle)


def test_files_that_are_missing_or_empty_are_refused(planned, tmp_path):
    np.save(tmp_path / "empty.npy", np.zeros((0, 3)))
    empty = schema.PointCloudObstacle(centre_m=[0.5, 0.0, 0.3], file=str(tmp_path / "empty.npy"))
    with pytest.raises(DatasetError, match="holds no points"):
        planned(empty)
    with pytest.raises(MissingData, match="not found"):
        planned(replace(empty, file=str(tmp_path / "nowhere.npy")))


def test_what_is_written_says_the_same_as_the_plan(inputs, middle_m, tmp_path):
    settings = schema.PlanningConfig(leave_data_m=LEAVE_M)
    config = PlanStageConfig(settings, METRIC, sphere(middle_m, 0.02), FRAME, {"a.obj": "0f"})
    plan(config, inputs, run_in(tmp_path / "found"))
    document = json.loads((tmp_path / "found/plan.json").read_text())
    assert document["found"]
    assert document["obstacles"] == ["sphere"]
    assert document["obstacle_files"] == {"a.obj": "0f"}
    with np.load(tmp_path / "found/path.npz") as path:
        assert len(path["position_m"]) == len(path["codes"]) == document["legs"][0]["points"]
        np.testing.assert_allclose(np.linalg.norm(path["orientation"], axis=1), 1)
    assert (tmp_path / "found/figures/plan.png").stat().st_size > 0
    assert "plotly" in (tmp_path / "found/scene.html").read_text()[:100_000].lower()


def test_without_a_path_none_is_written(inputs, middle_m, tmp_path):
    plan(
        PlanStageConfig(schema.PlanningConfig(), METRIC, sphere(middle_m, 0.15), FRAME), inputs, run_in(tmp_path / "no")
    )
    assert json.loads((tmp_path / "no/plan.json").read_text())["legs"][0]["blocking"] == ["sphere"]
    assert not (tmp_path / "no/path.npz").exists()
