import hashlib
import json

import numpy as np
import pytest

from geomotion.config import FolderDataset, LasaDataset, LettersDataset, RoboTasks9Dataset
from geomotion.demos import storage
from geomotion.demos.preprocessing import preprocess
from geomotion.demos.readers import read
from geomotion.errors import DatasetError, InvalidSetting, UnknownName
from geomotion.stages.ingest import ingest, summary_table
from geomotion.tracking import StageRun


class Client:
    """Stands in for MLflow's and remembers the datasets it was told of."""

    def __init__(self):
        self.datasets = []

    def log_inputs(self, run_id, datasets):
        self.datasets += [(run_id, entry.dataset.name, entry.dataset.digest) for entry in datasets]


@pytest.fixture
def client():
    return Client()


@pytest.fixture
def run(tmp_path, client):
    (tmp_path / "out").mkdir()
    return StageRun(tmp_path / "out", tmp_path / "checkpoint.pt", client=client, run_id="0")


@pytest.fixture
def letters():
    return LettersDataset(name="letters/s", letter="s", demos=5)


def test_what_is_written_is_what_was_read_and_preprocessed(letters, run):
    ingest(letters, {}, run)
    stored = storage.load(run.folder)
    expected = preprocess(read(letters), letters.preprocess)
    assert stored.steps == expected.steps
    assert len(stored.steps) == 3
    for found, wanted in zip(stored.trajectories, expected.trajectories, strict=True):
        np.testing.assert_array_equal(found.time_s, wanted.time_s)
        np.testing.assert_array_equal(found.velocity(["position_m"]), wanted.velocity(["position_m"]))


def test_the_dataset_is_linked_to_the_run_with_a_digest_of_its_samples(letters, run, client):
    ingest(letters, {}, run)
    samples = (run.folder / storage.DATA).read_bytes()
    assert client.datasets == [("0", "letters/s", hashlib.sha256(samples).hexdigest()[:36])]


def test_the_summary_is_a_document_and_a_table(letters, run):
    ingest(letters, {}, run)
    summary = json.loads((run.folder / "summary.json").read_text())
    assert [demo["set"] for demo in summary["demos"]] == ["train"] * 3 + ["test"] * 2
    assert "generated" in summary_table(summary)


def test_the_picture_comes_with_its_data(letters, run):
    ingest(letters, {}, run)
    figures = run.folder / "figures"
    assert (figures / "demonstrations.png").read_bytes().startswith(b"\x89PNG")
    assert (figures / "demonstrations.pdf").read_bytes().startswith(b"%PDF")
    with np.load(figures / "demonstrations.npz") as data:
        np.testing.assert_array_equal(data["demo_4_position_m"], storage.load(run.folder)[4].channels["position_m"])


def test_the_same_configuration_gives_the_same_bytes(letters, run):
    def contents():
        return {path.name: path.read_bytes() for path in run.folder.rglob("*") if path.is_file()}

    ingest(letters, {}, run)
    first = contents()
    ingest(letters, {}, run)
    assert contents() == first


@pytest.mark.parametrize(("shapes", "space"), [(["Angle"], "R2"), (["Angle", "Sine"], "R4")])
def test_real_handwriting_alone_and_stacked(lasa_folder, run, shapes, space):
    ingest(LasaDataset(name="lasa/test", shapes=shapes, root=str(lasa_folder)), {}, run)
    assert storage.load(run.folder).space == space


def test_real_poses(robotasks9_folder, run):
    ingest(RoboTasks9Dataset(name="robotasks9/pouring", task="pouring", root=str(robotasks9_folder)), {}, run)
    assert storage.load(run.folder).channel_names == ("position_m", "orientation_wxyz", "velocity_m_per_s")


def test_what_was_ingested_can_be_ingested_again(letters, run, tmp_path):
    ingest(letters, {}, run)
    stored = storage.load(run.folder)
    again = read(FolderDataset(name="folder", root=str(run.folder)))
    assert again.steps == stored.steps


@pytest.mark.parametrize(
    ("settings", "error"),
    [
        ({"train_demos": [9]}, InvalidSetting),
        ({"state_channels": ["positon_m"]}, UnknownName),
    ],
)
def test_settings_that_do_not_fit_leave_nothing_behind(run, settings, error):
    with pytest.raises(error):
        ingest(LettersDataset(name="letters/s", letter="s", **settings), {}, run)
    assert list(run.folder.iterdir()) == []


def test_a_bad_recording_leaves_nothing_behind(run, tmp_path):
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "a.csv").write_text("time_s,x,y\n0,1,2\n1,nan,2\n")
    with pytest.raises(DatasetError, match=r"a\.csv: demonstration 0 \(a\), row 1"):
        ingest(FolderDataset(name="folder", root=str(folder)), {}, run)
    assert list(run.folder.iterdir()) == []
