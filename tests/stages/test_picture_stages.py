"""From demonstrations and pictures to two policies that act, at toy size; a dozen CPU-seconds, mostly training."""

import numpy as np
import pytest

from geomotion import config as schema
from geomotion.demos import readers, storage
from geomotion.demos.preprocessing import preprocess
from geomotion.errors import InvalidSetting, ShapeMismatch
from geomotion.files import read_json
from geomotion.models import ModelConfig
from geomotion.networks.image_encoder import ImageEncoder
from geomotion.pictured_skills import Eye, Sighting, load_policy
from geomotion.stages.embed import EmbedConfig, embed
from geomotion.stages.encode import EncodeConfig, encode
from geomotion.stages.episodes import EpisodesStageConfig, episodes, episodes_table
from geomotion.stages.snapshots import SnapshotsConfig, snapshots
from geomotion.stages.train import TrainConfig, train
from geomotion.tracking import Artefacts

from .presets import running

DATASET = schema.GraspAndDropDataset(
    name="panda/grasp_and_drop", demos=1, points=60, snapshots=3, snapshots_on_the_way=3, snapshots_between=0,
    picture_px=32, scenery=0.0,
)  # fmt: skip
ENCODER = schema.EncoderConfig(tiles=1, steps=20)
SEEN_BY = EncodeConfig(ENCODER.weights, ENCODER.tiles, ENCODER.seed)
MODEL = ModelConfig(
    schema.FlowChart(layers=4, features=16), schema.LinearField(), schema.NoRegulariser(), 0, schema.LearnedTimeLaw()
)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """All stages up to both embeddings."""
    root = tmp_path_factory.mktemp("pictures")
    found = {"ingest": Artefacts("ingest", "0", root / "ingest", "")}
    storage.save(preprocess(readers.read(DATASET), DATASET.preprocess), root / "ingest")

    def produce(name, stage, config, inputs):
        stage(config, inputs, running(root / name))
        found[name] = Artefacts(name, "0", root / name, "")

    produce("snapshots", snapshots, SnapshotsConfig(DATASET), found)
    produce("encode", encode, SEEN_BY, found)
    for skill in schema.ManipulationSkill:
        chosen = schema.DatasetConfig(DATASET.name, None, *DATASET.demos_of(skill))
        training = schema.TrajectoryTraining(
            steps=3, ramp_steps=1, starts=2, times=8, curve_points=16, velocity_points=64, haste_points=16
        )
        produce(f"train {skill.value}", train, TrainConfig(chosen, MODEL, training, 0), found)
        trained = found | {"train": found[f"train {skill.value}"]}
        produce(f"embed {skill.value}", embed, EmbedConfig(ENCODER, skill), trained)
    return found


@pytest.fixture(scope="module")
def policy(done):
    eye = Eye(ImageEncoder("random"), DATASET.picture_px)
    return load_policy(done["train grasp"].path("model.pt"), done["embed grasp"].path("embedding.pt"), eye)


def test_random_weights_are_named_wherever_features_are_used(done):
    for name, file in (("encode", "encoder.json"), ("embed grasp", "embedding.json")):
        assert "random weights" in done[name].path(file).read_text()
    assert len(read_json(done["encode"].path("encoder.json"))["weights_sha256"]) == 64


def test_the_same_scene_without_variation_is_told_right(done):
    for skill, looks in (("grasp", 2), ("drop", 1)):  # before the grasp with the hand at rest, and on its way
        judged = read_json(done[f"embed {skill}"].path("embedding.json"))["held_out"]
        assert judged["place_accuracy"] == 1.0 and judged["confusion"] == (looks * np.eye(3, dtype=int)).tolist()


def test_every_condition_has_a_certificate(done):
    certificate = read_json(done["train drop"].path("certificate.json"))
    assert certificate["claim"] == "by_construction" and certificate["rate_per_s"] > 0


@pytest.mark.slow
def test_episodes_are_counted_and_filmed(done, tmp_path):
    few = schema.EpisodesConfig(
        per_place=0, between=0, moved=1, control_hz=10.0, looks_per_s=2.0, look_until_m=0.01, film_fps=0.5
    )
    run = running(tmp_path / "episodes")
    episodes(EpisodesStageConfig(few, DATASET, SEEN_BY), done, run)
    document = read_json(run.folder / "episodes.json")
    assert "random weights" in document["encoder"]["weights"]
    (row,) = document["episodes"]
    assert row["looks"] > 2 and len(row["moved_after_s"]) == 1
    assert document["groups"]["moved"]["succeeded"] == row["succeeded"]
    assert "moved to another place" in episodes_table(document)
    assert (run.folder / "film.gif").stat().st_size > 0


def test_other_weights_than_those_of_the_training_are_refused(done, tmp_path):
    changed = EpisodesStageConfig(schema.EpisodesConfig(), DATASET, EncodeConfig("random", ENCODER.tiles, seed=1))
    with pytest.raises(InvalidSetting, match=r"encoder\.weights.*changed since"):
        episodes(changed, done, running(tmp_path / "episodes"))


def test_a_policy_that_begins_again_has_seen_nothing(policy):
    policy.look(np.full((32, 32, 3), 200, np.uint8))
    policy.begin()
    np.testing.assert_array_equal(policy.condition, np.full(3, 1 / 3))


def test_pictures_of_another_size_are_refused(policy):
    with pytest.raises(ShapeMismatch, match="32 x 32, as in training, found 48 x 48"):
        policy.look(np.zeros((48, 48, 3), np.uint8))


def test_equal_pictures_are_encoded_once(policy, monkeypatch):
    picture = np.full((32, 32, 3), 77, np.uint8)
    first = policy.eye.features(picture[None])
    monkeypatch.setattr(policy.eye, "encoder", None)
    np.testing.assert_array_equal(policy.eye.features(picture[None]), first)


def test_one_doubtful_picture_is_not_believed_but_two_are():
    sighting = Sighting(lambda condition: condition)
    here, near, there = np.array([0.0, 0.0]), np.array([0.02, 0.0]), np.array([0.3, 0.0])
    sighting.note(here)
    np.testing.assert_allclose(sighting.note(near), [0.01, 0.0])
    np.testing.assert_allclose(sighting.note(there), [0.01, 0.0])
    np.testing.assert_allclose(sighting.note(there), there)
