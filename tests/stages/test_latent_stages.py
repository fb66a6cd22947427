"""The thesis' latent fields through the stages: decoder first, then the field of codes; rollouts from the manifold."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from geomotion import config as schema
from geomotion import models
from geomotion.demos import storage
from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.dynamics.injective import decoder_of
from geomotion.errors import InvalidSetting
from geomotion.files import read_json
from geomotion.models import ModelConfig
from geomotion.scores.contraction import judge_contraction
from geomotion.stages.evaluate import compute
from geomotion.stages.rollout import RolloutStageConfig, rollout
from geomotion.stages.train import TrainConfig, train
from geomotion.tracking import Artefacts, StageRun

SELECTION = schema.DatasetConfig("test/arcs", train_demos=[0, 1], test_demos=[2])
VAE = schema.VaeTraining(steps=20, batch_points=32)
CHART = schema.InjectiveVaeChart(units=8)
LINE_INTEGRAL = (
    ModelConfig(CHART, schema.LineIntegralField(hidden_units=[8]), schema.ConstantRegulariser(), 0),
    schema.VelocityTraining(steps=5),
)
EXACT = (
    ModelConfig(
        replace(CHART, code_flow=schema.FlowChart(layers=2, features=8)),
        schema.LinearField(),
        schema.NoRegulariser(),
        0,
    ),
    schema.TrajectoryTraining(steps=5),
)
FEW = schema.EvaluationConfig(
    contraction_grid_points=3, region_starts=4, region_steps=20, verify_cells=0, nearby_starts=2
)


def arcs() -> Demonstrations:
    time_s = np.linspace(0, 2, 30)
    angle = 1.2 * (1 - time_s / 2) ** 2
    demos = []
    for radius in (0.1, 0.11, 0.09):
        states = radius * np.stack(
            [np.cos(angle), np.sin(angle), np.sin(2 * angle) / 2, np.cos(2 * angle) / 3], axis=-1
        )
        velocity = np.gradient(states, time_s, axis=0)
        demos.append(Trajectory(time_s, {"position_m": states, "velocity_m_per_s": velocity}))
    return Demonstrations("test/arcs", tuple(demos), "R4")


def stage_run(folder) -> StageRun:
    folder.mkdir()
    run = StageRun(folder, folder.with_name("checkpoint"), client=None, run_id="1")
    run.log_series = lambda step, values: None
    return run


FREE = schema.NoObstacle()


@pytest.fixture(scope="module", params=[LINE_INTEGRAL, EXACT], ids=["line integral", "exact"])
def artefacts(request, tmp_path_factory) -> dict[str, Artefacts]:
    model, training = request.param
    root = tmp_path_factory.mktemp("latent")
    storage.save(arcs(), root / "ingest")
    ingested = {"ingest": Artefacts("ingest", "0", root / "ingest", "")}
    train(TrainConfig(SELECTION, model, training, 0, vae=VAE), ingested, stage_run(root / "train"))
    return ingested | {"train": Artefacts("train", "1", root / "train", "")}


def test_the_loaded_model_has_the_trained_decoder_and_codes(artefacts):
    skill = models.load(artefacts["train"].path("model.pt"))
    assert skill.field.dim == 4 and skill.field.field.dim == 2
    untrained = models.build(skill.config, skill.geometry)
    x = torch.tensor(arcs()[0].channels["position_m"], dtype=torch.float32)
    missed = [(decoder_of(one).project(x) - x).norm(dim=-1).mean() for one in (skill.field, untrained)]
    assert missed[0] < 0.5 * missed[1]
    header = artefacts["train"].path("vae_training.csv").read_text().splitlines()[0]
    assert header == "step,total,reconstruction,divergence,learning_rate"


def test_all_scores_can_be_taken(artefacts):
    skill = models.load(artefacts["train"].path("model.pt"))
    rate = read_json(artefacts["train"].path("certificate.json"))["rate_per_s"]
    scores = compute(skill, arcs(), rate, FEW, schema.SolverConfig()).scores
    jump, start_error = scores["heldout.manifold.starts_distance"], scores["heldout.start_error"]
    assert start_error.value == pytest.approx(jump.value, rel=1e-3), "motions begin at the projection"
    if rate is not None:
        assert scores["contraction.claimed.rate"].value <= -rate * (1 - 1e-4)
        assert scores["nearby.claimed.bound_excess"].value <= 1e-6


def test_the_matrix_of_the_line_integral_is_judged_on_codes(artefacts):
    skill = models.load(artefacts["train"].path("model.pt"))
    found = judge_contraction(skill.field, torch.tensor(skill.geometry.centre).expand(4, 4), "")
    assert ("contraction.jhat.rate" in found.scores) == isinstance(skill.config.field, schema.LineIntegralField)
    assert found.arrays["claimed_eigenvalue"].shape == (4,)


def roll(artefacts, folder, transition_s: float | None, obstacle: schema.ObstacleConfig = FREE) -> np.ndarray:
    config = schema.RolloutConfig(
        starts_m=[[0.1, 0.03, -0.04, 0.02]], duration_s=2.0, points=17, transition_s=transition_s
    )
    stage = RolloutStageConfig(config, schema.SolverConfig(), obstacle)
    rollout(stage, artefacts, stage_run(folder))
    (found,) = storage.load(folder / "rollouts").trajectories
    return found.channels["position_m"]


def test_rollouts_are_led_to_the_manifold_or_stay_beside_it(artefacts, tmp_path):
    decoder = decoder_of(models.load(artefacts["train"].path("model.pt")).field)

    def offsets(states: np.ndarray) -> np.ndarray:
        with torch.no_grad():
            return decoder.split(torch.tensor(states, dtype=torch.float32))[1].norm(dim=-1).numpy()

    led, beside = (roll(artefacts, tmp_path / str(time), time) for time in (0.5, None))
    np.testing.assert_allclose(led[0], beside[0], atol=1e-6)
    assert offsets(beside).min() > 0.2 * offsets(beside)[0]
    assert offsets(led)[4:].max() < 1e-3 * offsets(led)[0]


def test_obstacles_move_on_during_the_transition(artefacts, tmp_path):
    """One that crosses the start while the motion is led, and is gone when it is followed: nothing but its distance."""
    free = roll(artefacts, tmp_path / "free", 0.5)
    away, speed = np.array([0.0, 0.0, 0.0, 1.0]), 40.0
    ball = schema.SphereObstacle(
        centre_m=(free[2] - 0.25 * speed * away).tolist(), radius_m=0.05, velocity_m_per_s=(speed * away).tolist()
    )
    passed = roll(artefacts, tmp_path / "passed", 0.5, ball)
    np.testing.assert_allclose(passed, free, atol=2e-3)
    (row,) = read_json(tmp_path / "passed/rollouts.json")["rollouts"]
    assert row["clearance_m"] == pytest.approx(-0.05, abs=0.01)


def test_a_transition_has_to_end_before_the_rollout(artefacts, tmp_path):
    with pytest.raises(InvalidSetting, match=r"^rollout\.transition_s="):
        roll(artefacts, tmp_path / "rollout", 2.0)


def test_codes_have_fewer_coordinates_than_states(artefacts, tmp_path):
    model = replace(LINE_INTEGRAL[0], chart=schema.InjectiveVaeChart(latent_dim=4))
    with pytest.raises(InvalidSetting, match=r"^chart\.latent_dim=4 is not valid: expected fewer than the 4"):
        train(TrainConfig(SELECTION, model, LINE_INTEGRAL[1], 0, vae=VAE), artefacts, stage_run(tmp_path / "train"))
