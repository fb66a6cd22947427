"""Safety regions in the rollout and evaluate stages: what is written, and what is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_module
from omegaconf import OmegaConf

from geomotion import config as schema
from geomotion import models
from geomotion.demos import storage
from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.errors import InvalidSetting
from geomotion.export import OnnxPolicy
from geomotion.figures.safety import save_safety_figures
from geomotion.files import read_json
from geomotion.models import ModelConfig, Skill
from geomotion.safe_skills import nearest_body_m
from geomotion.stages import safety_picture
from geomotion.stages.export import ExportConfig, export
from geomotion.stages.rollout import RolloutStageConfig, rollout
from geomotion.stages.safety import certificate_part, judge_safety, safe
from geomotion.tracking import Artefacts, StageRun
from geomotion.training.data import Geometry

SAFETY = schema.RiemannianSafety(points_per_axis=40)
BALL = schema.SphereObstacle(centre_m=[0.05, 0.002, 0.0], radius_m=0.006)


class Unlogged(StageRun):
    """One that logs nothing elsewhere."""

    def log_series(self, *_) -> None: ...

    def log_policy(self, *_) -> None: ...


@pytest.fixture(scope="module")
def skill() -> Skill:
    """A skill of two dimensions in space that runs straight to the origin."""
    field = schema.LinearField(2, 10.0, min_rate_per_duration=0.1, initial_rate_per_duration=2.0)
    config = ModelConfig(schema.IdentityChart(), field, schema.NoRegulariser(), seed=0)
    geometry = Geometry((0.05, 0.0, 0.0), 0.05, (0.05, 0.0, 0.0), (0.0, 0.0, 0.0), duration_s=1.0)
    return Skill(models.build(config, geometry).eval(), config, geometry, ("position_m",), (0, 1, 2), ())


@pytest.fixture(scope="module")
def demonstrations() -> Demonstrations:
    time_s = np.linspace(0, 1, 60)
    demos = []
    for height in (0.02, 0.0, -0.02):
        states = np.outer(1 - time_s, [0.1, height, 0.0])
        velocity = np.tile([-0.1, -height, 0.0], (60, 1))
        demos.append(Trajectory(time_s, {"position_m": states, "velocity_m_per_s": velocity}))
    return Demonstrations("test/straight", tuple(demos), "R3")


@pytest.fixture
def inputs(skill: Skill, demonstrations: Demonstrations, tmp_path: Path) -> dict[str, Artefacts]:
    storage.save(demonstrations, tmp_path / "ingest")
    models.save(tmp_path / "train" / "model.pt", skill)
    return {name: Artefacts(name, "0", tmp_path / name, "") for name in ("ingest", "train")}


def test_motions_from_random_starts_stay_in_the_support_and_out_of_the_obstacle(
    skill, demonstrations, tmp_path, monkeypatch
):
    region = safe(SAFETY, BALL, skill, demonstrations)
    settings = schema.EvaluationConfig(goal_duration=2.5)
    evaluation, starts = judge_safety(region, demonstrations, settings, count=40)
    values = {name: score.value for name, score in evaluation.scores.items()}
    assert values["safety.left_support"] == values["safety.entered_obstacle"] == values["safety.never_reached"] == 0
    assert values["safety.entered_obstacle_without_region"] > 0.1
    assert values["safety.clearance"] > 0 > values["safety.clearance_without_region"]
    assert values["safety.unchanged"] > 0.3
    assert set(certificate_part(evaluation)["measured"]) == set(values)
    monkeypatch.setattr(safety_picture, "STEPS", 60)
    save_safety_figures(safety_picture.safety_picture(region, starts[:5]), tmp_path)
    assert {path.name for path in tmp_path.glob("*.png")} == {
        "safety_switching.png",
        "safety_distance.png",
        "safety_motion.png",
    }


def test_a_rollout_goes_around_the_obstacle_and_back_to_the_surface(inputs, tmp_path):
    starts = schema.RolloutConfig(starts_m=[[0.09, 0.002, 0.004]], duration_s=2.5, points=40)
    (tmp_path / "rollout").mkdir()
    run = StageRun(tmp_path / "rollout", tmp_path / "checkpoint", client=None, run_id="1")
    rollout(RolloutStageConfig(starts, schema.SolverConfig(), BALL, SAFETY), inputs, run)
    (row,) = read_json(run.folder / "rollouts.json")["rollouts"]
    assert row["reached_goal"]
    assert row["clearance_m"] > 0
    states = storage.load(run.folder / "rollouts")[0].channels["position_m"]
    assert np.abs(states[-1, 2]) < 1e-4  # decayed as without a region
    np.testing.assert_allclose(states[:, 2], 0.004 * np.exp(-10 * np.linspace(0, 2.5, 40)), atol=1e-5)


def test_a_skill_of_three_dimensions_is_refused(skill, demonstrations):
    whole = replace(skill.config, field=schema.LinearField(min_rate_per_duration=0.1, initial_rate_per_duration=2.0))
    other = replace(skill, field=models.build(whole, skill.geometry).eval(), config=whole)
    with pytest.raises(InvalidSetting, match="skill_dim"):
        safe(SAFETY, BALL, other, demonstrations)


def test_free_motion_needs_no_region(skill, demonstrations):
    assert safe(schema.NoSafety(), BALL, skill, demonstrations) is None


@pytest.mark.parametrize("figure", ["fig_6_5", "fig_6_17"])
def test_presets_ask_for_a_region_with_an_obstacle_in_it(figure):
    with initialize_config_module(version_base="1.3", config_module="geomotion.conf"):
        config = OmegaConf.to_object(compose("ncds", overrides=[f"experiment=thesis/{figure}"]))
    assert isinstance(config.safety, schema.RiemannianSafety)
    assert isinstance(config.obstacle, schema.SolidObstacle)


@pytest.mark.parametrize(
    "wrong", [{"rho": 0.0}, {"nu": 1.0}, {"support_quantile": 0.0}, {"margin_m": -0.1}, {"points_per_axis": 5}]
)
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(InvalidSetting):
        schema.RiemannianSafety(**wrong)


@pytest.mark.usefixtures("without_shape_checks")
def test_an_exported_policy_stays_in_the_region_that_it_was_given(inputs, skill, demonstrations, tmp_path):
    (tmp_path / "export").mkdir()
    run = Unlogged(tmp_path / "export", tmp_path / "checkpoint", client=None, run_id="1")
    export(ExportConfig(schema.PolicyConfig(), safety=SAFETY, obstacle=BALL), inputs, run)
    document = read_json(run.folder / "policy.json")
    assert document["max_difference_to_torch"]["velocity_m_per_s"] < 1e-5
    assert document["safety"]["rho"] == SAFETY.rho
    policy, region = OnnxPolicy(run.folder / "policy.onnx"), safe(SAFETY, BALL, skill, demonstrations)
    state, clearances = np.array([[0.09, 0.002, 0.0]], np.float32), []
    for _ in range(250):
        answer = policy({"state_m": state})
        assert answer["safety_distance"] > SAFETY.rho
        state = state + 0.01 * answer["velocity_m_per_s"]
        clearances.append(nearest_body_m(region.bodies, state.astype(float))[0])
    assert min(clearances) > 0
    assert np.linalg.norm(state) < 5e-3
