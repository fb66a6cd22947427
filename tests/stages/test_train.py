"""Training as a stage: what it writes, and what it refuses before it spends time."""

import pytest
import torch

from geomotion import config as schema
from geomotion import models
from geomotion.demos import readers, storage
from geomotion.demos.preprocessing import preprocess
from geomotion.dynamics.rollout import rollout
from geomotion.dynamics.start_memory import StartMemory
from geomotion.errors import InvalidSetting
from geomotion.files import read_json
from geomotion.models import ModelConfig
from geomotion.stages.train import TrainConfig, train
from geomotion.tracking import Artefacts, StageRun
from geomotion.training.data import TrainingSet
from geomotion.training.nearest_path import path_nearest_to

LETTERS = schema.LettersDataset(name="letters/s", letter="s", demos=3, points=40)
LINEAR = ModelConfig(schema.IdentityChart(), schema.LinearField(), schema.NoRegulariser(), 0)
LINE_INTEGRAL = ModelConfig(
    schema.IdentityChart(),
    schema.LineIntegralField(hidden_units=[8], skew=True),
    schema.EigenvalueRegulariser(),
    0,
)


@pytest.fixture
def ingested(tmp_path) -> dict[str, Artefacts]:
    storage.save(preprocess(readers.read(LETTERS), LETTERS.preprocess), tmp_path / "ingest")
    return {"ingest": Artefacts("ingest", "0", tmp_path / "ingest", "")}


@pytest.fixture
def run(tmp_path) -> StageRun:
    (tmp_path / "train").mkdir()
    run = StageRun(tmp_path / "train", tmp_path / "checkpoint", client=None, run_id="1")
    run.log_series = lambda step, values: None
    return run


def test_what_training_was_taken_back_from_is_written_down(ingested, run, monkeypatch):
    from geomotion.training.objectives import VelocityReconstruction

    whole = VelocityReconstruction.__call__

    def broken_once(objective, model, progress, generator):
        losses = whole(objective, model, progress, generator)
        return {"velocity": losses["velocity"] * torch.inf} if progress == 0.5 else losses

    monkeypatch.setattr(VelocityReconstruction, "__call__", broken_once)
    train(TrainConfig(LETTERS, LINE_INTEGRAL, schema.VelocityTraining(steps=4), 0), ingested, run)
    expected = {"step": 2, "loss": None, "to_step": 0, "learning_rate_factor": 0.3}
    assert read_json(run.folder / "training.json") == {"returns": [expected]}


def test_every_loss_is_kept_and_the_model_can_be_read(ingested, run):
    training = schema.VelocityTraining(steps=4, log_every_steps=1, curl_weight=0.1)
    train(TrainConfig(LETTERS, LINE_INTEGRAL, training, 0), ingested, run)
    header, *rows = (run.folder / "training.csv").read_text().splitlines()
    assert header.split(",") == ["step", "total", "velocity", "regulariser", "curl", "learning_rate"]
    assert len(rows) == 4
    skill = models.load(run.folder / "model.pt")
    assert skill.config == LINE_INTEGRAL
    assert torch.isfinite(skill.field(skill.goal)).all()


@pytest.mark.parametrize("one_path", [True, False])
def test_a_skill_of_one_dimension_follows_the_path_nearest_to_what_was_shown_however_short_the_training(
    ingested, run, one_path
):
    field = schema.LinearField(skill_dim=1, start_fade_durations=1.0)
    model = ModelConfig(schema.FlowChart(layers=2), field, schema.NoRegulariser(), 0, schema.LearnedTimeLaw())
    train(TrainConfig(LETTERS, model, schema.TrajectoryTraining(steps=4, one_path=one_path), 0), ingested, run)
    skill = models.load(run.folder / "model.pt")
    memory, channels = skill.field.start_memory, skill.state_channels
    data = TrainingSet.from_demonstrations(storage.load(ingested["ingest"].folder), channels).select(skill.train_demos)
    shown = StartMemory(2, float(memory.fade_s))
    shown.learn(torch.stack([states[0] for states in data.states]))
    path = path_nearest_to(data.without_offsets(shown), skill.geometry)
    times = torch.linspace(0, skill.geometry.duration_s, len(path))
    motion = rollout(skill.field, memory.mean_start[None], times).states[0]
    apart = (motion - path).norm(dim=-1) / skill.geometry.scale_m
    assert (float(apart[10:-10].mean()) < 0.01) is one_path


PRIMITIVE = ModelConfig(schema.IdentityChart(), schema.MovementPrimitiveField(), schema.NoRegulariser(), 0)
REFUSED = {
    "training.curl_weight=": (LINEAR, schema.VelocityTraining(curl_weight=0.1)),
    "training=": (LINE_INTEGRAL, schema.TrajectoryTraining()),
    "training=velocity is not valid: expected closed_form": (PRIMITIVE, schema.VelocityTraining()),
    "training=adjoint is not valid: expected closed_form": (PRIMITIVE, schema.AdjointTraining()),
}


@pytest.mark.parametrize("words", REFUSED)
def test_an_objective_that_does_not_suit_the_field_is_refused(ingested, run, words):
    model, training = REFUSED[words]
    with pytest.raises(InvalidSetting, match=f"^{words}"):
        train(TrainConfig(LETTERS, model, training, 0), ingested, run)
    assert not list(run.folder.iterdir())
