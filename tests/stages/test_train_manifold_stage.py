"""Training a manifold as a stage: what it writes, and what it refuses before it spends time."""

import json
from dataclasses import replace

import numpy as np
import pytest

from geomotion import config as schema
from geomotion import manifold_models
from geomotion.demos import readers, storage
from geomotion.demos.demonstrations import Demonstrations
from geomotion.errors import DatasetError
from geomotion.stages.train_manifold import TrainManifoldConfig, train_manifold
from geomotion.tracking import Artefacts, StageRun

JC = schema.JCDataset(name="generated/jc", demos=5, points=40)
LETTERS = schema.LettersDataset(name="letters/s", letter="s", demos=3, points=40)
MANIFOLD = schema.ManifoldConfig(kernels=30, hidden_units=[16, 8], points=20)
TRAINING = schema.ManifoldTraining(steps=12, spread_steps=6, restarts=0, log_every_steps=1)
CONFIG = TrainManifoldConfig(schema.DatasetConfig("generated/jc"), MANIFOLD, TRAINING, 0, None, schema.PandaArm())


@pytest.fixture
def train(tmp_path):
    """Train on demonstrations and answer with the folder of outputs."""

    def run(demonstrations: Demonstrations, config: TrainManifoldConfig = CONFIG):
        storage.save(demonstrations, tmp_path / "ingest")
        run = StageRun(tmp_path / "train", tmp_path / "checkpoint", client=None, run_id="1")
        run.folder.mkdir()
        run.log_series = lambda step, values: None
        train_manifold(config, {"ingest": Artefacts("ingest", "0", tmp_path / "ingest", "")}, run)
        return run.folder

    return run


def test_the_manifold_can_be_read_and_every_loss_is_kept(train):
    folder = train(readers.read(JC))
    skill = manifold_models.load(folder / "model.pt")
    assert (skill.train_demos, skill.test_demos) == ((0, 1, 2), (3, 4))
    assert skill.config == replace(MANIFOLD, latent_dim=2)
    assert skill.arm is None
    for name, rows in (("training", 12), ("spreads", 6)):
        assert len((folder / f"{name}.csv").read_text().splitlines()) == 1 + rows
    training = json.loads((folder / "training.json").read_text())
    assert training["attempts"] == 1
    assert 0 <= training["folded_share"] <= 1
    assert (folder / "figures/training.png").stat().st_size > 0


def test_demonstrations_without_orientation_are_refused_with_what_is_needed(train):
    with pytest.raises(DatasetError, match="needs position_m and either orientation_wxyz or direction_xyz"):
        train(readers.read(LETTERS))


def test_positions_that_stay_are_refused_even_where_rounding_moves_them(train):
    demonstrations = readers.read(JC)
    still = [
        replace(one, channels={**one.channels, "position_m": np.full((40, 2), 0.1) + 1e-9 * np.eye(40, 2)})
        for one in demonstrations.trajectories
    ]
    with pytest.raises(DatasetError, match="expected motion"):
        train(replace(demonstrations, trajectories=tuple(still)))


def test_more_kernels_than_poses_are_refused(train):
    few = replace(CONFIG, manifold=replace(MANIFOLD, kernels=1000))
    with pytest.raises(DatasetError, match=r"points to train on, fewer than manifold\.kernels=1000"):
        train(readers.read(JC), few)
