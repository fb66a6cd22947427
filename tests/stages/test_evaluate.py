"""The evaluate stage on a model that drew its own demonstrations, so that the right scores are known."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from geomotion import config as schema
from geomotion import models
from geomotion.config import EvaluationConfig, Protocol, SolverConfig
from geomotion.demos import storage
from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.demos.preprocessing import preprocess
from geomotion.dynamics.certificate import certify
from geomotion.errors import InvalidSetting
from geomotion.files import read_json, write_json
from geomotion.models import ModelConfig, Skill
from geomotion.scores.score import Score
from geomotion.stages.evaluate import EvaluateConfig, audit, compute, evaluate, require_peers_data, state_unit
from geomotion.stages.evaluate_obstacles import judge_among_obstacles
from geomotion.tracking import Artefacts, StageRun
from geomotion.training.data import Geometry

SETTINGS = EvaluationConfig(contraction_grid_points=5, region_starts=9, region_steps=60, goal_duration=6.0)
SOLVER = SolverConfig()
DEMOS = 5


def make_skill(
    dim: int = 2,
    chart: schema.ChartConfig | None = None,
    field: schema.FieldConfig | None = None,
    time_law: schema.TimeLawConfig | None = None,
) -> Skill:
    regulariser = (
        schema.ConstantRegulariser() if isinstance(field, schema.LineIntegralField) else schema.NoRegulariser()
    )
    config = ModelConfig(
        chart or schema.FlowChart(layers=4, features=20),
        field or schema.LinearField(initial_rate_per_duration=4.0),
        regulariser,
        seed=0,
        time_law=time_law or schema.NoTimeLaw(),
    )
    geometry = Geometry((0.05,) * dim, 0.1, (0.04,) * dim, (0.02,) * dim, 2.5)
    model = models.build(config, geometry)
    with torch.no_grad():
        for number, parameter in enumerate(model.parameters()):
            parameter += 0.05 * torch.randn(parameter.shape, generator=torch.Generator().manual_seed(number))
    return Skill(model.eval(), config, geometry, ("position_m",), (0, 1, 2), (3, 4))


def draw_demonstrations(skill: Skill) -> Demonstrations:
    """Trajectories of the model's own field, with its own velocities."""
    generator = np.random.default_rng(0)
    trajectories = []
    for number in range(DEMOS):
        time_s = np.linspace(0.0, 2.0 + 0.2 * number, 50 + number)
        start = torch.tensor([[0.12, 0.14, 0.1][: skill.field.dim]]) + 0.02 * torch.tensor(
            generator.normal(size=(1, skill.field.dim)), dtype=torch.float32
        )
        with torch.no_grad():
            states = skill.field.solve(start, torch.tensor(time_s, dtype=torch.float32))[0]
            channels = {"position_m": states, "velocity_m_per_s": skill.field(states)}
        trajectories.append(Trajectory(time_s, {name: values.double().numpy() for name, values in channels.items()}))
    return Demonstrations("test/own", tuple(trajectories), f"R{skill.field.dim}")


@pytest.fixture(scope="module")
def skill() -> Skill:
    return make_skill()


@pytest.fixture(scope="module")
def demonstrations(skill: Skill) -> Demonstrations:
    return draw_demonstrations(skill)


@pytest.fixture(scope="module")
def scores(skill: Skill, demonstrations: Demonstrations) -> dict[str, Score]:
    return compute(skill, demonstrations, proven_rate(skill), SETTINGS, SOLVER).scores


def proven_rate(skill: Skill) -> float | None:
    return certify(skill.field, torch.full((1, skill.field.dim), 0.05)).rate_per_s


def test_a_model_reproduces_what_it_drew(scores):
    for subset in ("train", "heldout"):
        for name in ("dtwd_per_point", "frechet", "start_error", "end_point_error", "time_aligned_rmse"):
            assert scores[f"{subset}.{name}"].value < 1e-3, name  # mm, in single precision
        assert scores[f"{subset}.relative_velocity_error"].value < 1e-5
    assert scores["train.dtwd_ratio"].value < 1e-3
    assert scores["heldout.dtwd_to_nearest_demo"].value > 1
    assert (scores["train.dtwd_per_point"].count, scores["heldout.dtwd_per_point"].count) == (3, 2)


def test_a_certified_model_contracts_where_it_claims_to(skill, scores):
    rate = proven_rate(skill)
    assert scores["contraction.claimed.rate"].value == pytest.approx(-rate, rel=1e-4)
    assert scores["contraction.claimed.non_contracting_fraction"].value == 0
    assert scores["nearby.claimed.bound_excess"].value < 1e-5
    assert scores["goal.never_reached"].value == 0


def test_every_score_has_a_unit_a_count_and_a_finite_value(scores):
    for name, score in scores.items():
        assert score.unit, name
        assert score.count >= 1, name
        assert np.isfinite(score.value), name


def test_the_solver_that_is_asked_for_is_used(skill, demonstrations):
    coarse = replace_rows(demonstrations, slice(None, None, 10))
    by_steps = compute(skill, coarse, None, SETTINGS, SolverConfig(method=schema.SolverMethod.rk4))
    assert 1e-3 < by_steps.scores["train.time_aligned_rmse"].value < 10


def replace_rows(demonstrations: Demonstrations, rows: slice) -> Demonstrations:
    thinned = [
        Trajectory(one.time_s[rows], {name: values[rows] for name, values in one.channels.items()})
        for one in demonstrations.trajectories
    ]
    return replace(demonstrations, trajectories=tuple(thinned))


def test_a_proven_bound_is_not_held_against_errors_of_coarse_steps(demonstrations):
    skill = make_skill(field=schema.PotentialField(units=8), time_law=schema.LearnedTimeLaw(knots=4))
    with torch.no_grad():
        skill.field.field.raw_gain += 6.0  # too steep for one RK4 step between output times
    coarse = replace_rows(demonstrations, slice(None, None, 16))
    settings = replace(SETTINGS, contraction_grid_points=2, region_starts=4, region_steps=5)
    scores = compute(skill, coarse, proven_rate(skill), settings, SOLVER).scores
    assert scores["nearby.claimed.bound_excess"].value < 1e-8


def test_more_dimensions_leave_out_what_needs_a_plane():
    skill = make_skill(dim=3)
    evaluation = compute(skill, draw_demonstrations(skill), proven_rate(skill), SETTINGS, SOLVER)
    assert "two dimensions; the state has 3" in evaluation.omitted["region"]
    assert "field_points" not in evaluation.arrays
    assert evaluation.arrays["grid_points"].shape == (25, 3)
    assert evaluation.arrays["grid_shape"].size == 0
    assert "random points" in evaluation.scores["contraction.true.rate"].note


def test_a_line_integral_field_shows_its_matrix_and_proves_nothing(demonstrations):
    field = schema.LineIntegralField(hidden_units=[10])
    skill = make_skill(chart=schema.IdentityChart(), field=field)
    evaluation = compute(skill, demonstrations, proven_rate(skill), SETTINGS, SOLVER)
    assert evaluation.scores["contraction.jhat.non_contracting_fraction"].value == 0
    assert evaluation.arrays["jhat_eigenvalue"].shape == (25,)
    assert evaluation.arrays["nearby_bound"].size == 0
    np.testing.assert_allclose(evaluation.arrays["true_eigenvalue"], evaluation.arrays["claimed_eigenvalue"], rtol=1e-3)


def test_the_peers_protocol_judges_trained_demonstrations_only(skill, demonstrations):
    settings = replace(SETTINGS, protocol=Protocol.peers)
    evaluation = compute(skill, demonstrations, None, settings, SOLVER)
    assert not any(name.startswith("heldout.") for name in evaluation.scores)
    assert "demo_3" not in evaluation.arrays


def test_the_peers_protocol_accepts_their_data_as_preprocessing_records_it(demonstrations):
    long = replace(demonstrations, steps=())
    trimmed = preprocess(long, schema.PreprocessConfig(trim_start_points=15))
    require_peers_data((0, 1, 2, 3, 4), trimmed.steps)
    otherwise = preprocess(long, schema.PreprocessConfig(trim_start_points=14))
    for train_demos, steps in (((0, 1, 2, 3), trimmed.steps), ((0, 1, 2, 3, 4), otherwise.steps)):
        with pytest.raises(InvalidSetting, match="trim_start_points=15"):
            require_peers_data(train_demos, steps)


def test_lengths_are_reported_in_millimetres_and_angles_in_radians():
    assert state_unit(["position_m"]).name == "mm"
    assert state_unit(["joints_rad"]).name == "rad"
    assert state_unit(["position_m", "joints_rad"]).name == "state unit"


@pytest.fixture
def inputs(tmp_path: Path, skill: Skill, demonstrations: Demonstrations) -> dict[str, Artefacts]:
    ingested, trained = tmp_path / "ingest", tmp_path / "train"
    storage.save(demonstrations, ingested)
    models.save(trained / "model.pt", skill)
    write_json(trained / "certificate.json", certify(skill.field, torch.full((1, 2), 0.05)).as_dict())
    return {"ingest": Artefacts("ingest", "0", ingested, ""), "train": Artefacts("train", "1", trained, "")}


@pytest.fixture
def run(tmp_path: Path) -> StageRun:
    folder = tmp_path / "evaluate"
    folder.mkdir()
    return StageRun(folder, tmp_path / "checkpoint", client=None, run_id="2")


def test_among_obstacles_contraction_is_measured_and_the_claim_stays_that_of_free_space(inputs, run):
    ball = schema.SphereObstacle(centre_m=[0.07, 0.08], radius_m=0.015, escape=False)
    evaluate(EvaluateConfig(SETTINGS, SOLVER, ball), inputs, run)
    certificate = read_json(run.folder / "certificate.json")
    measured = certificate["obstacles"]["measured"]
    assert certificate["claim"] == "by_construction"
    assert "not proven" in certificate["obstacles"]["statement"]
    assert measured["obstacles.contraction.claimed.rate"] > -certificate["rate_per_s"]
    assert 0 <= measured["obstacles.contraction.true.non_contracting_fraction"] <= 1
    assert measured["obstacles.passage.clearance"] > -1e-3  # mm, in single precision
    assert measured["obstacles.nearby.claimed.max_expansion"] >= 1
    scores = read_json(run.folder / "scores.json")["scores"]
    assert scores["obstacles.passage.never_reached"]["count"] <= 9


def test_what_remembers_starts_is_judged_among_obstacles_as_displaced_from_one():
    """Motions that an obstacle stops are followed anew on their own, fewer than there were."""
    field = schema.LinearField(skill_dim=1, start_fade_durations=1.0, initial_rate_per_duration=4.0)
    skill = make_skill(field=field, time_law=schema.LearnedTimeLaw())
    demonstrations = draw_demonstrations(skill)
    memory, trained = skill.field.start_memory, demonstrations.select(skill.train_demos)
    memory.learn(torch.tensor(np.stack([one.state(("position_m",))[0] for one in trained.trajectories])).float())
    memory.carry(0.01 * torch.randn(20, 2, generator=torch.Generator().manual_seed(0)), 2.0)
    ball = schema.SphereObstacle(centre_m=[0.07, 0.08], radius_m=0.015)
    scores = judge_among_obstacles(skill, demonstrations, ball, SETTINGS, SOLVER).scores
    assert scores["obstacles.passage.clearance"].value > -1e-3
    assert scores["obstacles.nearby.claimed.max_expansion"].value >= 1


def test_the_stage_writes_what_it_computed(inputs, run, scores):
    evaluate(EvaluateConfig(SETTINGS, SOLVER), inputs, run)
    document = read_json(run.folder / "scores.json")
    assert (document["protocol"], document["dataset"]) == ("heldout", "test/own")
    assert document["scores"].keys() == scores.keys()
    assert document["scores"]["train.dtwd_per_point"] == json.loads(
        json.dumps(scores["train.dtwd_per_point"].as_dict())
    )
    certificate = read_json(run.folder / "certificate.json")
    assert certificate["claim"] == "by_construction"
    assert certificate["audit"]["contraction.claimed.rate"] == document["scores"]["contraction.claimed.rate"]["value"]
    with np.load(run.folder / "evaluation.npz", allow_pickle=False) as arrays:
        assert arrays["region_rollouts"].shape == (9, 60, 2)
        assert arrays["field_velocity"].shape == arrays["field_points"].shape == (1600, 2)
        assert [str(arrays[f"set_{number}"]) for number in range(DEMOS)] == ["train"] * 3 + ["test"] * 2
    assert (run.folder / "figures" / "motion.png").exists()
    assert not list(run.folder.glob(".*"))


def test_the_peers_protocol_is_refused_before_anything_is_written(inputs, run):
    with pytest.raises(InvalidSetting, match=r"evaluation=peers"):
        evaluate(EvaluateConfig(EvaluationConfig(protocol=Protocol.peers), SOLVER), inputs, run)
    assert not list(run.folder.iterdir())


def test_the_audit_holds_what_bears_on_contraction(skill, demonstrations):
    evaluation = compute(skill, demonstrations, proven_rate(skill), SETTINGS, SOLVER)
    found = audit(evaluation)
    assert {
        "contraction.true.rate",
        "contraction.claimed.non_contracting_fraction",
        "nearby.claimed.bound_excess",
    } <= set(found)
    assert not any(name.startswith(("train.", "goal.", "nearby.euclidean")) for name in found)
