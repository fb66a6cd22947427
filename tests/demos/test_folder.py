import json

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from geomotion.config import FolderDataset, LengthUnit
from geomotion.demos import storage
from geomotion.demos.readers import read
from geomotion.errors import CorruptArtefact, DatasetError, InvalidSetting, MissingData

TIME = np.linspace(0, 1, 11)
XY = np.stack([TIME, TIME**2], axis=1)


def config(root, **settings):
    return FolderDataset(name="folder", root=str(root), **settings)


def csv(folder, name="a", **columns):
    columns = columns or {"time_s": TIME, "x": XY[:, 0], "y": XY[:, 1]}
    pd.DataFrame(columns).to_csv(folder / f"{name}.csv", index=False)


def cells(row, column, value, name="x"):
    """The columns of a good file with one bad cell."""
    columns = {"time_s": TIME.astype(object), "x": XY[:, 0].astype(object), "y": XY[:, 1].astype(object)}
    columns[name][row] = value
    return columns


def test_csv_files_are_demonstrations_in_the_order_of_their_names(tmp_path):
    csv(tmp_path, "b")
    csv(tmp_path, "a", time_s=2 * TIME, x=XY[:, 0], y=XY[:, 1])
    (tmp_path / "notes.txt").write_text("not a recording")
    demonstrations = read(config(tmp_path))
    assert [trajectory.label for trajectory in demonstrations.trajectories] == ["a", "b"]
    assert [trajectory.duration_s for trajectory in demonstrations.trajectories] == [2, 1]
    np.testing.assert_array_equal(demonstrations[1].channels["position_m"], XY)
    assert demonstrations.space == "R2"


@pytest.mark.parametrize("column", ["demo", "episode", "episode_index"])
def test_a_column_tells_demonstrations_apart(tmp_path, column):
    labels = ["second"] * 4 + ["first"] * 7
    csv(tmp_path, **{column: labels, "time_s": np.r_[TIME[:4], TIME[:7]], "x": np.arange(11.0), "y": np.arange(11.0)})
    demonstrations = read(config(tmp_path))
    assert [trajectory.label for trajectory in demonstrations.trajectories] == ["second", "first"]
    np.testing.assert_array_equal(demonstrations[1].channels["position_m"][:, 0], np.arange(4.0, 11.0))


@pytest.mark.parametrize(
    ("names", "settings", "metres"),
    [
        (("x", "y"), {}, 1),
        (("x", "y"), {"length_unit": LengthUnit.mm}, 0.001),
        (("x_cm", "y_cm"), {"length_unit": LengthUnit.mm}, 0.01),
        (("position_m_x", "position_m_y"), {}, 1),
        (("position_mm_0", "position_mm_1"), {}, 0.001),
    ],
)
def test_lengths_become_metres(tmp_path, names, settings, metres):
    csv(tmp_path, time_s=TIME, **{names[1]: XY[:, 1], names[0]: XY[:, 0]})  # the order of columns does not matter
    np.testing.assert_allclose(read(config(tmp_path, **settings))[0].channels["position_m"], metres * XY)


def test_numbered_axes_are_sorted_by_number(tmp_path):
    csv(
        tmp_path,
        time_s=TIME,
        **{f"position_m_{axis}": np.full(11, float(axis)) for axis in (10, 2, 0, 1, 3, 4, 5, 6, 7, 8, 9)},
    )
    np.testing.assert_array_equal(read(config(tmp_path))[0].channels["position_m"][0], np.arange(11.0))


def test_joints_keep_the_order_of_the_file(tmp_path):
    one = np.ones(11)
    positions = {"joint_shoulder_rad": TIME, "joint_elbow_rad": -TIME}
    velocities = {"joint_shoulder_rad_per_s": one, "joint_elbow_rad_per_s": -one}
    csv(tmp_path, time_s=TIME, **positions, **velocities)
    demonstrations = read(config(tmp_path))
    np.testing.assert_array_equal(demonstrations[0].channels["joints_rad"], np.stack([TIME, -TIME], axis=1))
    np.testing.assert_array_equal(demonstrations[0].velocity(["joints_rad"])[0], [1, -1])
    assert demonstrations.space == "joint"


def test_poses_have_scalar_first_quaternions(tmp_path):
    quaternion = {f"orientation_{axis}": np.full(11, float(axis == "w")) for axis in "xyzw"}
    csv(tmp_path, time_s=TIME, x=TIME, y=TIME, z=TIME, **quaternion)
    demonstrations = read(config(tmp_path))
    assert demonstrations.space == "R3xS3"
    np.testing.assert_array_equal(demonstrations[0].channels["orientation_wxyz"][3], [1, 0, 0, 0])


def test_a_rate_stands_in_for_times(tmp_path):
    csv(tmp_path, x=XY[:, 0], y=XY[:, 1])
    with pytest.raises(DatasetError, match=r"a\.csv: holds no time; expected time_s, .*dataset\.sampling_rate_hz="):
        read(config(tmp_path))
    np.testing.assert_allclose(read(config(tmp_path, sampling_rate_hz=10.0))[0].time_s, TIME)


def test_npz_holds_one_demonstration_or_several(tmp_path):
    two = np.stack([XY, 2 * XY])
    np.savez(tmp_path / "a.npz", time_s=TIME, position_m=XY, velocity_m_per_s=2 * XY)
    np.savez(tmp_path / "b.npz", time_s=TIME, position_m=two, velocity_m_per_s=two)
    np.savez(tmp_path / "c.npz", time_s=np.stack([TIME, 3 * TIME]), position_m=two, velocity_m_per_s=two)
    demonstrations = read(config(tmp_path))
    assert [trajectory.label for trajectory in demonstrations.trajectories] == ["a", "0", "1", "0", "1"]
    assert [trajectory.duration_s for trajectory in demonstrations.trajectories] == [1, 1, 1, 1, 3]
    np.testing.assert_array_equal(demonstrations[2].channels["position_m"], 2 * XY)


def test_npz_may_hold_columns_too(tmp_path):
    np.savez(tmp_path / "a.npz", time_s=TIME, x=XY[:, 0], y=XY[:, 1])
    np.testing.assert_array_equal(read(config(tmp_path))[0].channels["position_m"], XY)


def test_parquet_holds_columns_or_lists(tmp_path):
    pq.write_table(pa.table({"time_s": TIME, "x": XY[:, 0], "y": XY[:, 1]}), tmp_path / "a.parquet")
    pq.write_table(pa.table({"timestamp": TIME, "position_m": XY.tolist()}), tmp_path / "b.parquet")
    demonstrations = read(config(tmp_path))
    for trajectory in demonstrations.trajectories:
        np.testing.assert_array_equal(trajectory.channels["position_m"], XY)


def test_a_dataset_of_our_own_comes_back_bit_by_bit(circles, tmp_path, same):
    storage.save(circles, tmp_path)
    same(read(config(tmp_path)), circles)


def lerobot(folder, names, width):
    states = [row.tolist() for row in np.random.default_rng(0).standard_normal((10, width))]
    frames = {"observation.state": states, "timestamp": np.r_[TIME[:5], TIME[:5]], "episode_index": [0] * 5 + [1] * 5}
    (folder / "data/chunk-000").mkdir(parents=True)
    (folder / "meta").mkdir()
    pq.write_table(
        pa.table(frames | {"task_index": [0] * 10, "done": [False] * 10}), folder / "data/chunk-000/file-000.parquet"
    )
    (folder / "meta/info.json").write_text(json.dumps({"features": {"observation.state": {"names": names}}}))
    return np.array(states)


def test_a_lerobot_dataset_is_read_by_the_names_of_its_axes(tmp_path):
    states = lerobot(tmp_path, ["joint_1_rad", "joint_2_rad", "x", "y"], 4)
    demonstrations = read(config(tmp_path, length_unit=LengthUnit.cm))
    assert len(demonstrations) == 2
    np.testing.assert_array_equal(demonstrations[1].channels["joints_rad"], states[5:, :2])
    np.testing.assert_allclose(demonstrations[1].channels["position_m"], states[5:, 2:] / 100)


def test_a_lerobot_state_of_two_nameless_axes_is_a_position(tmp_path):
    states = lerobot(tmp_path, None, 2)
    np.testing.assert_array_equal(read(config(tmp_path))[0].channels["position_m"], states[:5])


@pytest.mark.parametrize("names", [None, {"motors": ["a", "b"]}, ["x", "y", "z"]])
def test_a_lerobot_state_that_nobody_names_is_refused(tmp_path, names):
    lerobot(tmp_path, names, 7)
    with pytest.raises(DatasetError, match="expected a list of 7 names"):
        read(config(tmp_path))


BAD_COLUMNS = {
    "a NaN": (cells(3, "x", "nan"), r"demonstration 0 \(a\), row 3: position_m is .*finite"),
    "an infinity": (cells(3, "x", "-inf"), r"row 3: position_m is .*finite"),
    "an empty cell": (cells(3, "x", ""), r"row 3: position_m is .*finite"),
    "a word": (cells(3, "x", "oops"), r"row 3: x is 'oops'; expected a number"),
    "a time that goes back": (cells(5, "t", 0.1, "time_s"), r"row 5: time 0.1 s goes back from 0.4 s"),
    "a repeated time": (cells(5, "t", 0.4, "time_s"), r"row 5: time 0.4 s repeats 0.4 s"),
    "one point": ({"time_s": [0.0], "x": [1.0], "y": [1.0]}, r"has 1 point\(s\); expected at least 2"),
    "no rows": ({"time_s": [], "x": [], "y": []}, r"has 0 point\(s\)"),
    "an unknown column": ({"time_s": TIME, "positon_m_z": TIME}, "'positon_m_z'; did you mean 'position_m_z'"),
    "only time": ({"time_s": TIME}, "holds no positions or joints"),
    "two times": ({"time_s": TIME, "timestamp": TIME, "x": TIME}, "time_s and timestamp say the same"),
    "an axis twice": ({"time_s": TIME, "x": TIME, "x_mm": TIME}, "x_mm and x are the same axis"),
    "half a quaternion": (
        {"time_s": TIME, "orientation_w": TIME, "orientation_x": TIME},
        "orientation has axes w, x; expected w, x, y, z",
    ),
    "velocities of other axes": (
        {"time_s": TIME, "x": TIME, "y": TIME, "velocity_m_per_s_x": TIME},
        r"velocity_m_per_s has axes x; expected those of position_m \(x, y\)",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD_COLUMNS)
def test_a_bad_file_is_one_line_with_its_name(tmp_path, what):
    columns, words = BAD_COLUMNS[what]
    csv(tmp_path, **columns)
    with pytest.raises(DatasetError, match=words) as caught:
        read(config(tmp_path))
    assert str(caught.value).startswith(str(tmp_path / "a.csv"))
    assert "\n" not in str(caught.value)


def test_demonstrations_of_different_dimension_are_refused(tmp_path):
    csv(tmp_path, "a")
    csv(tmp_path, "b", time_s=TIME, x=TIME, y=TIME, z=TIME)
    with pytest.raises(DatasetError, match=r"demonstration 1 \(b\) has channels .*3.*; expected .*2"):
        read(config(tmp_path))


@pytest.mark.parametrize("suffix", ["csv", "npz", "parquet"])
@pytest.mark.parametrize("content", [b"", b"\x00\xff\xfe garbage", b"PK\x03\x04"])
def test_a_file_that_is_not_what_its_suffix_says_is_refused(tmp_path, suffix, content):
    (tmp_path / f"a.{suffix}").write_bytes(content)
    with pytest.raises(DatasetError) as caught:
        read(config(tmp_path, sampling_rate_hz=1.0))
    assert f"a.{suffix}" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("suffix", ["npz", "parquet"])
@pytest.mark.parametrize("kept", [0.3, 0.9, 0.99])
def test_a_truncated_file_is_refused(tmp_path, suffix, kept):
    path = tmp_path / f"a.{suffix}"
    if suffix == "npz":
        np.savez(path, time_s=TIME, position_m=XY)
    else:
        pq.write_table(pa.table({"time_s": TIME, "x": TIME, "y": TIME}), path)
    content = path.read_bytes()
    path.write_bytes(content[: int(kept * len(content))])
    with pytest.raises(DatasetError, match="truncated"):
        read(config(tmp_path))


def test_a_csv_file_cut_in_the_middle_of_a_row_is_refused(tmp_path):
    csv(tmp_path)
    path = tmp_path / "a.csv"
    path.write_text(path.read_text().rsplit(",", 1)[0])
    with pytest.raises(DatasetError, match=r"row 10: position_m is \[1.0, nan\]"):
        read(config(tmp_path))


def test_pickled_objects_are_refused(tmp_path):
    np.savez(tmp_path / "a.npz", time_s=np.array([{}], dtype=object))
    with pytest.raises(DatasetError, match="not an NPZ file of numbers"):
        read(config(tmp_path))


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"time_s": TIME[:5], "position_m": XY}, "different length"),
        (
            {"time_s": TIME, "position_m": np.zeros((2, 9, 2))},
            r"time_s has shape \(11,\); expected \(9,\) or \(2, 9, …\)",
        ),
        ({"time_s": TIME, "position_m": np.zeros(())}, r"position_m has shape \(\)"),
        ({"time_s": TIME, "orientation_wxyz": np.zeros((11, 3))}, "orientation_wxyz has 3 axes"),
        ({"time_s": TIME, "position": XY}, "unknown column 'position_0'"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(tmp_path, arrays, words):
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(DatasetError, match=words):
        read(config(tmp_path))


def test_ragged_lists_are_refused(tmp_path):
    pq.write_table(pa.table({"time_s": [0.0, 1.0], "position_m": [[1.0, 2.0], [1.0]]}), tmp_path / "a.parquet")
    with pytest.raises(DatasetError, match="same number in every row"):
        read(config(tmp_path))


def test_a_missing_folder_and_a_file_instead_of_one_say_what_to_do(tmp_path):
    with pytest.raises(MissingData, match=r"does not exist; set dataset\.root="):
        read(config(tmp_path / "nowhere"))
    csv(tmp_path)
    with pytest.raises(MissingData, match=r"is a file; set dataset\.root="):
        read(config(tmp_path / "a.csv"))


def test_an_empty_folder_lists_the_accepted_suffixes(tmp_path):
    with pytest.raises(DatasetError, match=r"expected files ending in \.csv, \.npz, \.parquet"):
        read(config(tmp_path))


def test_a_damaged_dataset_is_corrupt(circles, tmp_path):
    storage.save(circles, tmp_path)
    (tmp_path / storage.DATA).write_bytes(b"PAR1")
    with pytest.raises(CorruptArtefact):
        read(config(tmp_path))
    (tmp_path / storage.INFO).write_text("{")
    with pytest.raises(DatasetError, match="not a JSON document"):
        read(config(tmp_path))


def test_a_rate_below_zero_is_refused():
    with pytest.raises(InvalidSetting, match="sampling_rate_hz"):
        config("x", sampling_rate_hz=-1.0)
