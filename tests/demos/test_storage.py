import json
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

from geomotion.demos import storage
from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.errors import CorruptArtefact, MissingData


@pytest.mark.parametrize("name", ["circles", "poses"])
def test_a_dataset_comes_back_bit_by_bit(name, request, tmp_path, same):
    demonstrations = request.getfixturevalue(name)
    storage.save(demonstrations, tmp_path)
    same(storage.load(tmp_path), demonstrations)


def test_names_of_joints_come_back_and_older_datasets_have_none(poses, tmp_path, same):
    named = replace(poses, joint_names=("shoulder", "elbow", "wrist"))
    storage.save(named, tmp_path)
    same(storage.load(tmp_path), named)
    info = json.loads((tmp_path / storage.INFO).read_text())
    del info[storage.OWN_KEY]["joint_names"]
    (tmp_path / storage.INFO).write_text(json.dumps(info))
    same(storage.load(tmp_path), poses)


def test_every_float64_survives(tmp_path, same):
    generator = np.random.default_rng(0)
    values = generator.standard_normal((200, 8)) * 10.0 ** generator.integers(-300, 300, (200, 8))
    values[0] = [5e-324, -0.0, np.pi, 1 / 3, 1e308, -5e-324, 0.1, np.nextafter(1, 2)]
    time_s = np.cumsum(generator.uniform(1e-9, 1, 200))
    demonstrations = Demonstrations("random", (Trajectory(time_s, {"position_m": values}, "ü\n"),), "R8")
    storage.save(demonstrations, tmp_path)
    same(storage.load(tmp_path), demonstrations)


def test_saving_twice_replaces_the_dataset_and_gives_the_same_bytes(circles, poses, tmp_path, same):
    def contents():
        return {path.name: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}

    storage.save(poses, tmp_path)
    first = contents()
    storage.save(circles, tmp_path)
    same(storage.load(tmp_path), circles)
    storage.save(poses, tmp_path)
    assert contents() == first


def test_other_tools_find_samples_and_names(poses, tmp_path):
    storage.save(poses, tmp_path)
    info = json.loads((tmp_path / storage.INFO).read_text())
    table = pq.read_table(tmp_path / storage.DATA)
    state = info["features"]["observation.state"]
    assert state["names"][:4] == ["joint_1_rad", "joint_2_rad", "joint_3_rad", "orientation_w"]
    assert state["shape"] == [10] == [table["observation.state"].type.list_size]
    assert info["total_frames"] == table.num_rows == 71
    assert info["fps"] == 20
    np.testing.assert_array_equal(table["episode_index"].to_numpy(), np.repeat([0, 1], [41, 30]))
    episodes = pq.read_table(tmp_path / storage.EPISODES)
    assert episodes["length"].to_pylist() == [41, 30]
    assert episodes["dataset_to_index"].to_pylist() == [41, 71]


def test_velocities_are_the_actions(circles, tmp_path):
    storage.save(circles, tmp_path)
    action = pq.read_table(tmp_path / storage.DATA)["action"].to_pylist()
    np.testing.assert_array_equal(action[0], circles[0].channels["velocity_m_per_s"][0])


@pytest.mark.parametrize("name", [storage.DATA, storage.EPISODES, storage.INFO])
@pytest.mark.parametrize("damage", ["truncate", "flip", "empty"])
def test_a_damaged_file_is_found_out(circles, tmp_path, name, damage):
    storage.save(circles, tmp_path)
    path = tmp_path / name
    content = bytearray(path.read_bytes())
    middle = len(content) // 2
    content[middle] ^= 0x80
    path.write_bytes({"truncate": content[:middle], "flip": content, "empty": b""}[damage])
    with pytest.raises(CorruptArtefact, match=path.name):
        storage.load(tmp_path)


def test_a_file_that_is_gone_is_corruption_and_no_dataset_at_all_is_missing_data(circles, tmp_path):
    with pytest.raises(MissingData, match="repeat the stage"):
        storage.load(tmp_path)
    storage.save(circles, tmp_path)
    (tmp_path / storage.DATA).unlink()
    with pytest.raises(CorruptArtefact, match="missing"):
        storage.load(tmp_path)


@pytest.mark.parametrize("document", ["[]", "{}", '{"geomotion": {"sha256": {}}}', '{"geomotion": 3}'])
def test_a_description_of_something_else_is_corruption(circles, tmp_path, document):
    storage.save(circles, tmp_path)
    (tmp_path / storage.INFO).write_text(document)
    with pytest.raises(CorruptArtefact):
        storage.load(tmp_path)


def test_an_interrupted_save_leaves_no_dataset(circles, poses, tmp_path, monkeypatch):
    storage.save(poses, tmp_path)

    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(storage, "_write_tasks", stop)
    with pytest.raises(KeyboardInterrupt):
        storage.save(circles, tmp_path)
    with pytest.raises(MissingData):
        storage.load(tmp_path)
