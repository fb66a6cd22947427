import hashlib
from pathlib import Path

import numpy as np
import pytest

from geomotion.config import ROBOTASKS9_TASKS, RoboTasks9Dataset
from geomotion.demos.readers import read, robotasks9
from geomotion.errors import DatasetError, MissingData, UnknownName


def config(task="pouring", root=None, **settings):
    return RoboTasks9Dataset(name=f"robotasks9/{task}", task=task, root=root and str(root), **settings)


def test_every_task_has_a_checksum_and_the_files_have_them(robotasks9_folder):
    assert set(robotasks9.SHA256) == set(ROBOTASKS9_TASKS)
    for task, digest in robotasks9.SHA256.items():
        assert hashlib.sha256((robotasks9_folder / f"{task}.npy").read_bytes()).hexdigest() == digest


@pytest.mark.parametrize("task", ROBOTASKS9_TASKS)
def test_poses_are_within_the_reach_of_a_panda(robotasks9_folder, task):
    demonstrations = read(config(task, robotasks9_folder))
    assert (len(demonstrations), demonstrations.space) == (9, "R3xS3")
    ends = np.array([trajectory.channels["position_m"][-1] for trajectory in demonstrations.trajectories])
    np.testing.assert_allclose(ends, np.broadcast_to(ends[0], ends.shape), atol=1e-12)
    for trajectory in demonstrations.trajectories:
        position, q = trajectory.channels["position_m"], trajectory.channels["orientation_wxyz"]
        assert (position.shape, q.shape) == ((1000, 3), (1000, 4))
        assert np.linalg.norm(position, axis=1).max() < 0.855 + 0.15  # arm and hand [m]
        np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1, atol=1e-12)
        assert trajectory.duration_s == pytest.approx(999 / 60)


def test_the_sampling_rate_sets_the_clock(robotasks9_folder):
    demonstrations = read(config(root=robotasks9_folder, sampling_rate_hz=100.0))
    assert demonstrations[0].duration_s == pytest.approx(9.99)


def test_a_missing_file_says_where_to_get_it(tmp_path):
    with pytest.raises(MissingData, match=r"pouring\.npy .*raw\.githubusercontent.*dataset\.root="):
        read(config(root=tmp_path))


def test_offline_the_error_says_so_and_nothing_is_printed(monkeypatch, tmp_path, capfd):
    import pooch

    class Offline:
        def __init__(self, **_):
            pass

        def __call__(self, url, output_file, pooch):
            raise ConnectionError("no route")

    monkeypatch.setattr(pooch, "HTTPDownloader", Offline)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(MissingData, match="could not be downloaded"):
        read(config())
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("honest", [True, False])
def test_a_download_is_compared_with_its_checksum(robotasks9_folder, monkeypatch, tmp_path, honest):
    import pooch

    class Server:
        def __init__(self, **_):
            pass

        def __call__(self, url, output_file, pooch):
            content = (robotasks9_folder / url.rsplit("/", 1)[-1]).read_bytes()
            Path(output_file).write_bytes(content if honest else content[:-1] + b"\0")

    monkeypatch.setattr(pooch, "HTTPDownloader", Server)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    if honest:
        assert len(read(config())) == 9
    else:
        with pytest.raises(DatasetError, match="SHA-256"):
            read(config())


@pytest.mark.parametrize(
    ("write", "words"),
    [
        (lambda path: path.write_bytes(b""), "truncated"),
        (lambda path: path.write_bytes(b"\x93NUMPY\x01\x00"), "truncated"),
        (lambda path: np.save(path, np.zeros((9, 1000, 6))), r"shape \(9, 1000, 6\); expected \(demo, time, 7\)"),
        (lambda path: np.save(path, np.zeros((2, 10, 7))), r"demonstration 0, row 0: quaternion of norm 0"),
        (lambda path: np.save(path, np.array([{}], dtype=object), allow_pickle=True), "not a .npy file of numbers"),
    ],
)
def test_a_file_that_is_something_else_is_one_line_with_its_name(tmp_path, write, words):
    write(tmp_path / "pouring.npy")
    with pytest.raises(DatasetError, match=rf"pouring\.npy: .*{words}"):
        read(config(root=tmp_path))


def test_a_truncated_recording_is_found(robotasks9_folder, tmp_path):
    content = (robotasks9_folder / "pouring.npy").read_bytes()
    (tmp_path / "pouring.npy").write_bytes(content[: len(content) // 2])
    with pytest.raises(DatasetError, match="truncated"):
        read(config(root=tmp_path))


def test_an_unknown_task_is_met_with_the_closest_one():
    with pytest.raises(UnknownName, match="Did you mean 'pouring'"):
        config("puring")


def test_other_files_of_the_set_are_read_from_a_folder(robotasks9_folder, tmp_path):
    (tmp_path / "navigation.npy").write_bytes((robotasks9_folder / "scoop.npy").read_bytes())
    config = RoboTasks9Dataset(name="robotasks9/other", task="navigation", root=str(tmp_path))
    assert read(config).name == "robotasks9/navigation"


def test_an_environment_variable_names_a_folder_for_all_datasets_of_the_set(robotasks9_folder, monkeypatch):
    monkeypatch.setenv(robotasks9.FOLDER_VARIABLE, str(robotasks9_folder))
    assert len(read(config())) == 9


def test_what_the_named_folder_lacks_is_said(monkeypatch, tmp_path):
    monkeypatch.setenv(robotasks9.FOLDER_VARIABLE, str(tmp_path))
    with pytest.raises(MissingData, match="ROBOTASKS9_DATA_DIR"):
        read(config())
